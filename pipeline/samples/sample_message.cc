#include "pipeline/samples/sample_message.h"

namespace eventgan {

void SampleMessage::fail(std::string reason) {
  sample.valid = false;
  const std::string id = " (" + sample.sample_id + ")";
  if (!reason.ends_with(id)) reason += id;
  sample.fault = std::move(reason);
  prepared = {};
  volume = {};
  chunk = {};
}

}  // namespace eventgan
