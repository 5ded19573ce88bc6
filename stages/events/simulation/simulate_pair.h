#pragma once

#include <memory>
#include <vector>

#include "manifests/values/counter_random.h"
#include "manifests/values/events.h"
#include "manifests/values/frames.h"
#include "stages/events/simulation/interval.h"
#include "stages/events/simulation/sensor.h"

namespace eventgan {

/// Shows the sensor images 1..steps() of the interval, evenly spaced in (from_s, to_s], and
/// appends what it sees to `events`, in order of time. The sensor must have seen image 0 (or the
/// last of the interval before) at from_s. Throws as Sensor::step.
void feed_interval(Sensor& sensor, const Interval& interval, double from_s, double to_s,
                   std::vector<Event>& events);

/// Two frames and no image between them: the sensor itself takes the log intensity to move on a
/// line from one to the next. It has no flow.
std::unique_ptr<Interval> fade_between(GreyImage previous, GreyImage next);

// The events of a pair, in an interval of `duration_s` > 0 and from a sensor that starts at rest at
// t = 0, pixel by pixel as pixel_events gives them: throw as it does. Thread safe.

/// ESIM as the EventGAN paper compares with: one image (the previous frame) under a random affine
/// motion whose largest displacement is drawn uniformly from [0, max_displacement_px); the next
/// frame is not looked at. Throws std::invalid_argument if max_displacement_px is below 0.
std::vector<Event> simulate_affine(const GreyImage& image, double max_displacement_px,
                                   const SensorSpec& sensor, double duration_s,
                                   CounterRandom random);

/// Of images, two or more of one size, that are seen one after the other, evenly spaced in time.
std::vector<Event> simulate_images(const std::vector<GreyImage>& images, const SensorSpec& sensor,
                                   double duration_s, CounterRandom random);

/// The earlier works in the paper: each pixel's log intensity moves on a line from its value in the
/// previous frame to that in the next, whatever moved in between: floor(|L1 - L0| / C) events a
/// pixel, evenly spaced. Throws std::invalid_argument if the frames differ in size.
std::vector<Event> simulate_difference(const GreyImage& previous, const GreyImage& next,
                                       const SensorSpec& sensor, double duration_s,
                                       CounterRandom random);

}  // namespace eventgan
