#include "tests/stages/shards/example_shard.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>
#include <string>
#include <utility>

#include "stages/shards/codec/volume_codec.h"
#include "stages/shards/shard_writer.h"

namespace eventgan::testing {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// Images of 16 x 12 pixels become volumes of 8 x 6: s = 1/2 on both axes, so a point maps as (x +
// 0.5) / 2 - 0.5 = x / 2 - 0.25 and an edge as x / 2.
Point half(const Point& p) {
  return p == kMissingPoint ? p : Point{p.x / 2 - 0.25, p.y / 2 - 0.25};
}
Rectangle half(const Rectangle& r) { return {r.left / 2, r.top / 2, r.right / 2, r.bottom / 2}; }

VolumeStatistics statistics_of(const std::vector<float>& volume) {
  VolumeStatistics statistics;
  std::size_t nonzero = 0;
  for (std::size_t i = 0; i < volume.size(); ++i) {
    statistics.max = std::max(statistics.max, volume[i]);
    nonzero += volume[i] != 0;
    (i < volume.size() / 2 ? statistics.sum_positive : statistics.sum_negative) += volume[i];
  }
  if (nonzero == 0) statistics.flags = kFlagEmpty;
  statistics.nonzero_fraction = static_cast<float>(nonzero) / static_cast<float>(volume.size());
  statistics.eta98 = statistics.max;
  return statistics;
}

ShardSample sample(int number) {
  ShardSample sample;
  sample.sample_id = "00000" + std::to_string(number);
  sample.sequence = "drive_" + std::to_string(number / 2);
  sample.origin = {"S1", number == 0 ? "" : "Walking-1", "54138969", sample.sequence};
  sample.pair.previous = {"kitti/prev_2/00000" + std::to_string(number) + "_02.png", 10 + number,
                          -1, 1.0};
  sample.pair.next = {"kitti/image_2/00000" + std::to_string(number) + ".png", 12 + number, -1,
                      1.0 + 0.2};
  sample.pair.gap_frames = 2;
  sample.pair.label_index = 12 + number;
  sample.pair.label_position = 1;
  sample.source_size = {12, 16};
  sample.source_to_volume = {0.5, 0, -0.25, 0, 0.5, -0.25};
  return sample;
}

void add_box(ShardSample& to, int class_id, const Rectangle& source, const Rectangle& clipped) {
  Box box;
  box.class_id = class_id;
  box.xyxy = source;
  box.ignore = class_id == 1;
  to.annotation.boxes.push_back(box);
  to.labels.boxes.push_back({clipped, half(source), box.ignore, {}});
}

void add_person(ShardSample& to, const Person& person) {
  VolumePerson mapped;
  for (const Joint& joint : person.joints) mapped.joints.push_back(half(joint.at));
  mapped.center = half(person.center);
  mapped.scale = person.scale < 0 ? -1 : person.scale / 2;
  if (person.head_box) mapped.head_box = half(*person.head_box);
  if (person.box) mapped.box = half(*person.box);
  if (person.camera) {
    mapped.camera = {person.camera->focal_x / 2, person.camera->focal_y / 2,
                     half(Point{person.camera->centre_x, 0}).x,
                     half(Point{0, person.camera->centre_y}).y};
  }
  to.annotation.persons.push_back(person);
  to.labels.persons.push_back(mapped);
}

Person plain_person() {
  Person person;
  person.joints = {{{3.5, 4}, 1}, {{5, 6.25}, 0}, {kMissingPoint, 0}};
  return person;
}

Person full_person() {
  Person person = plain_person();
  person.joints[2] = {{7, 7}, -1};
  person.center = {6, 5};
  person.scale = 1.75;
  person.head_box = Rectangle{1, 2, 5, 6.5};
  person.box = Rectangle{3.5, 4, 8, 8};
  person.joints3d_mm = {std::nullopt, std::array{4.0, 5.0, 3001.0}, std::array{7.0, 8.0, 3002.0}};
  person.camera = Intrinsics{1145.0494, 1143.7811, 7.5, 5.5};
  person.distortion = {.k1 = -0.2071, .k2 = 0.2478, .k3 = -0.0031, .p1 = -0.0014, .p2 = -0.001};
  return person;
}

/// Two channels a polarity, all different values, about half of them zero.
std::vector<float> volume(int number, std::size_t size) {
  std::vector<float> values(size);
  for (std::size_t i = 0; i < size; i += 2) {
    values[i] = static_cast<float>((i * 7 + static_cast<std::size_t>(number)) % 101) / 80.0f;
  }
  return values;
}

ShardHeader header(StoredType type, int deflate_level) {
  ShardHeader header;
  header.name = "demo-train-00000-of-00001.h5";
  header.dataset = "kitti_object";
  header.split = "train";
  header.volume = {2, {6, 8}};
  header.dtype = type;
  header.deflate_level = deflate_level;
  header.preprocessing = R"({"fit":"stretch","grey":"before_resize","blur":3,"preset":"kitti"})";
  header.plan_hash = std::string(64, 'a');
  header.manifest_text = "{ \"name\": \"d\xc3\xa9mo\" }\n";
  header.weights = "shipped:8";
  header.weights_hash = std::string(64, 'b');
  header.generator = "a fake generator";
  header.program_version = "0.1.0";
  return header;
}

void add(ExampleShard& shard, ShardSample sample, std::vector<float> values) {
  if (sample.valid && shard.header.tile_px > 0) {
    sample.tiles = {1, 1, 0, 1};  // 2 x 2 of 4 px in 6 x 8
    for (const int row : {4, 5, 10, 11, 16, 17, 22, 23}) std::fill_n(&values[8 * row], 4, 0.0f);
  }
  if (sample.valid) sample.statistics = statistics_of(values);
  shard.samples.push_back(std::move(sample));
  shard.volumes.push_back(std::move(values));
  shard.header.sample_count = static_cast<int>(shard.samples.size());
}

}  // namespace

ExampleShard example_shard(StoredType type, int deflate_level) {
  ExampleShard shard{header(type, deflate_level), {}, {}};
  shard.header.scope = "motion";
  shard.header.tile_px = 4;
  shard.header.label_schema = {
      {"Car", "DontCare"}, {"nose", "left hand", "right hand"}, {"", "left_wrist", "right_wrist"}};
  const std::size_t size = shard.header.volume.value_count();

  ShardSample first = sample(0);
  first.annotation.original = "Car 0.10 0 1.57 2.00 2.00 8.50 9.00\r\nDontCare\n";
  add_box(first, 0, {2, 2, 8.5, 9}, {1, 1, 4.25, 4.5});
  add_box(first, 1, {0, 0, 1, 1}, {0, 0, 0.5, 0.5});
  first.annotation.boxes[0].truncation = 0.1f;
  first.annotation.boxes[0].occlusion = 0;
  first.annotation.boxes[0].alpha = 1.57f;
  first.annotation.boxes[0].box3d = {1.5f, 1.6f, 3.9f, -2, 1.7f, 20, 0.1f};
  first.annotation.boxes[0].track_id = 7;
  first.annotation.boxes[0].difficulty = 1;
  Outline& outline = first.annotation.boxes[0].outline;  // with a hole
  outline = {{{{2, 2}, {8.5, 2}, {8.5, 9}, {2, 9}}, {{4, 4}, {4, 6}, {6, 6}, {6, 4}}}};
  first.labels.boxes[0].outline = outline;
  for (auto& ring : first.labels.boxes[0].outline.rings) {
    for (Point& corner : ring) corner = {corner.x / 2, corner.y / 2};
  }
  // P' of M = [1/2 0 -1/4; 0 1/2 -1/4]: rows 1/2 r1 - 1/4 r3, 1/2 r2 - 1/4 r3, r3.
  first.annotation.projection = {700, 0, 8, 40, 0, 700, 6, 2, 0, 0, 1, 4};
  first.labels.projection = {350, 0, 3.75, 19, 0, 350, 2.75, 0, 0, 0, 1, 4};
  add_person(first, plain_person());
  add_person(first, full_person());
  add(shard, first, volume(0, size));

  ShardSample unlabelled = sample(1);
  unlabelled.pair.next.time_s = kNan;
  add(shard, unlabelled, std::vector<float>(size));

  ShardSample broken = sample(2);
  broken.valid = false;
  broken.fault = "cannot decode kitti/image_2/000002.png (000002)";
  broken.source_size = {};
  broken.source_to_volume.fill(kNan);
  broken.annotation.original = std::string("any \0 byte", 10);
  add(shard, broken, {});

  ShardSample cut = sample(3);
  cut.pair.previous.video_frame = 10;
  cut.pair.next.video_frame = 12;
  add_box(cut, 0, {10, -3, 17, 6}, {5, 0, 8, 3});
  cut.pair.objects = {ImageMotion{0.5, -2.25, 1.5, 0.984375}};
  add(shard, cut, volume(3, size));

  ShardSample person = sample(4);  // of a still
  person.threshold = 0.3125;
  person.pair.previous = person.pair.next;
  person.pair.previous.time_s = kNan;
  person.pair.motion = ImageMotion{-1.5, 0.25, 0.75, 1.0078125};
  // Seen in both images from the column on, and up to the row, that the flow leads back into them.
  const ImageSize pixels = shard.header.volume.size;
  for (const float px : {0.5f, -0.25f}) {
    person.flow.px.insert(person.flow.px.end(), pixels.pixel_count(), px);
  }
  for (int y = 0; y < pixels.height; ++y) {
    for (int x = 0; x < pixels.width; ++x) {
      person.flow.valid.push_back(x - 0.5 >= 0 && y + 0.25 <= pixels.height - 1);
    }
  }
  add_person(person, plain_person());
  add(shard, person, volume(4, size));
  return shard;
}

ExampleShard unlabelled_shard() {
  ExampleShard shard{header(StoredType::kFloat32, 0), {}, {}};
  add(shard, sample(0), volume(0, shard.header.volume.value_count()));
  return shard;
}

CommitRecord write_shard(const std::filesystem::path& folder, const ExampleShard& example) {
  const VolumeCodec codec(example.header.dtype, example.header.deflate_level);
  CommitRecord record;
  record.shard = example.header.name;
  record.plan_hash = example.header.plan_hash;
  record.samples = example.header.sample_count;
  ShardWriter writer(folder, example.header);
  for (std::size_t slot = 0; slot < example.samples.size(); ++slot) {
    ShardSample sample = example.samples[slot];
    EncodedVolume encoded;
    if (sample.valid) {
      encoded = codec.encode(example.volumes[slot]);
      if (encoded.saturated) sample.statistics.flags |= kFlagSaturated;
      if (encoded.vanished) sample.statistics.flags |= kFlagVanished;
      sample.scale = encoded.scale;
      ++record.valid;
    } else {
      record.quarantined.push_back({static_cast<int>(slot), sample.sample_id, sample.fault});
    }
    writer.append(sample, encoded.chunk);
  }
  ShardReceipt receipt = writer.commit();
  record.sha256 = receipt.sha256;
  record.size_bytes = receipt.size_bytes;
  record.contents = std::move(receipt.contents);
  return record;
}

}  // namespace eventgan::testing
