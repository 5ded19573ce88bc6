#pragma once

#include "manifests/documents/detail/fields.h"
#include "manifests/values/events.h"
#include "manifests/values/simulation.h"
#include "manifests/values/training.h"

namespace eventgan {

// The tables of the documents' fields (fields.h).

void list_training(Fields& fields, TrainingManifest& manifest);
void list_simulation(Fields& fields, SimulationManifest& manifest);
void list_camera_sensor(Fields& fields, CameraSensor& sensor);

/// A simulated sensor's settings.
void list_sensor(Fields& fields, SensorSpec& spec);

/// A contrast threshold, `what` says of what, and its ratio.
void list_threshold(Fields& fields, std::optional<ThresholdSpec>& threshold, std::string_view what);

void list_noise(Fields& fields, NoiseSpec& spec);

inline constexpr char kSeedField[] =
    "Decides everything that is drawn at random: the same seed draws the same.";

}  // namespace eventgan
