#include <algorithm>
#include <initializer_list>

#include "manifests/generator_spec_internal.h"
#include "manifests/job_words_internal.h"
#include "manifests/sensor_spec_internal.h"
#include "manifests/weights_name.h"

namespace eventgan {
namespace {

/// Reads the keys that only some kinds of generator have.
class KindKeys {
 public:
  /// `kind`: none if the manifest's is faulty; then no key is out of place.
  KindKeys(StrictObject& object, std::optional<GeneratorKind> kind)
      : object_(object), kind_(kind) {}

  /// The key's value if it is there. It is a fault where the kind is not one of `owners`.
  std::optional<StrictValue> find(std::string_view key,
                                  std::initializer_list<GeneratorKind> owners) {
    std::optional<StrictValue> value = object_.find(key);
    if (!value || !kind_ || std::ranges::find(owners, *kind_) != owners.end()) return value;
    std::string listed;
    for (const GeneratorKind owner : owners) {
      listed.append(listed.empty() ? "" : ", ").append(to_string(owner));
    }
    value->fault("no such key for kind \"" + std::string(to_string(*kind_)) + "\" (of " + listed +
                 " only)");
    return std::nullopt;
  }

 private:
  StrictObject& object_;
  std::optional<GeneratorKind> kind_;
};

}  // namespace

GeneratorSpec read_generator(const StrictValue& value) {
  using enum GeneratorKind;
  GeneratorSpec spec;
  StrictObject object = value.object();
  std::optional<GeneratorKind> kind = spec.kind;
  if (const auto found = object.find("kind")) kind = found->sound_choice(kGeneratorWords);
  spec.kind = kind.value_or(spec.kind);

  KindKeys keys(object, kind);
  if (const auto weights = keys.find("weights", {kNetwork})) {
    spec.weights = weights->text(
        "the path of a .safetensors file, \"shipped\", or \"shipped:WIDTH\" or "
        "\"untrained:WIDTH\" with WIDTH in 1..64",
        [](std::string_view text) { return parse_weights_name(text).has_value(); });
  }
  if (const auto engine = keys.find("engine", {kNetwork})) {
    spec.engine = engine->choice(kEngineWords);
  }
  if (const auto precision = keys.find("precision", {kNetwork})) {
    spec.precision = precision->choice(kPrecisionWords);
  }
  if (const auto sensor = keys.find("sensor", {kEsim, kDifference})) {
    spec.sensor = read_sensor(*sensor);
  }
  if (const auto duration = keys.find("duration_s", {kEsim, kDifference})) {
    spec.duration_s = duration->number(1e-4, 10);
  }
  if (const auto displacement = keys.find("max_displacement_px", {kEsim})) {
    spec.max_displacement_px = displacement->number(0.1, 100);
  }
  object.finish();
  return spec;
}

}  // namespace eventgan
