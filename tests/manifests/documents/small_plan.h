#pragma once

#include "manifests/documents/plan.h"

namespace eventgan::testing {

/// Two shards of two sources: every field of a plan that can be present or absent is, once.
Plan small_plan();

}  // namespace eventgan::testing
