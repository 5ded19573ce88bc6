#include "stages/recordings/readers/dhp19_events.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "manifests/values/faults.h"
#include "stages/base/hdf5/hdf5.h"
#include "stages/recordings/order/event_check.h"
#include "stages/recordings/readers/detail/hdf5_table.h"

namespace eventgan {
namespace {

constexpr double kSeconds = 1e-6;  // of a time stamp

}  // namespace

struct Dhp19Events::File {
  /// A row or column of numbers.
  class Column {
   public:
    Column(hid_t file, const std::string& path, const std::string& name)
        : table_(file, path, name) {
      const Dims& dims = table_.dims();
      const auto longest = std::ranges::max_element(dims);
      if (dims.empty() || std::ranges::count(dims, hsize_t{1}) + 1 < std::ssize(dims)) {
        table_.refuse("numbers [1, N]");
      }
      axis_ = static_cast<std::size_t>(longest - dims.begin());
    }

    std::int64_t count() const { return static_cast<std::int64_t>(table_.dims()[axis_]); }
    const Hdf5Table& table() const { return table_; }

    std::vector<double> read(std::int64_t first, std::int64_t count) const {
      Dims start(table_.dims().size(), 0);
      Dims block(table_.dims().size(), 1);
      start[axis_] = static_cast<hsize_t>(first);
      block[axis_] = static_cast<hsize_t>(count);
      std::vector<double> values(static_cast<std::size_t>(count));
      if (count > 0) table_.read(start, block, values.data());
      return values;
    }

   private:
    Hdf5Table table_;
    std::size_t axis_ = 0;
  };

  struct Camera {
    Column time_us, x, y, polarity;

    Camera(hid_t file, int number, const std::string& name)
        : time_us(file, group(number) + "timeStamp", name),
          x(file, group(number) + "x", name),
          y(file, group(number) + "y", name),
          polarity(file, group(number) + "polarity", name) {
      for (const Column* column : {&x, &y, &polarity}) {
        if (column->count() == time_us.count()) continue;
        column->table().refuse("as many numbers as timeStamp, " + std::to_string(time_us.count()));
      }
    }

    static std::string group(int number) { return "cam" + std::to_string(number) + "/"; }
  };

  std::string name;
  Hdf5Handle hdf5;  ///< before what is in it, so that it closes last
  std::vector<Camera> cameras;
  double start_us = 0;

  const Camera& camera(int number) const { return cameras.at(static_cast<std::size_t>(number)); }

  double time_us(int number, std::int64_t event) const {
    const double time = camera(number).time_us.read(event, 1)[0];
    if (std::isfinite(time)) return time;
    throw InputError("expected a finite time, got another, in " + name + " (cam" +
                     std::to_string(number) + ", event " + std::to_string(event) + ")");
  }
};

Dhp19Events::Dhp19Events(const std::filesystem::path& path)
    : file_(std::make_unique<File>(File{path.string(), {}, {}, 0})) {
  read_hdf5(file_->name, [&] {
    file_->hdf5 = open_hdf5_file(path);
    bool any = false;
    for (int i = 0; i < kDhp19Cameras; ++i) {
      file_->cameras.emplace_back(file_->hdf5, i, file_->name);
      if (count(i) == 0) continue;
      const double first_us = file_->time_us(i, 0);
      file_->start_us = any ? std::min(file_->start_us, first_us) : first_us;
      any = true;
    }
  });
}

Dhp19Events::~Dhp19Events() = default;
Dhp19Events::Dhp19Events(Dhp19Events&&) noexcept = default;

std::int64_t Dhp19Events::count(int camera) const { return file_->camera(camera).time_us.count(); }

double Dhp19Events::time_s(int camera, std::int64_t event) const {
  return read_hdf5(file_->name,
                   [&] { return (file_->time_us(camera, event) - file_->start_us) * kSeconds; });
}

std::vector<Event> Dhp19Events::events(int camera, std::int64_t first, std::int64_t count) const {
  const File::Camera& columns = file_->camera(camera);
  std::vector<double> times_us, x, y, polarity;
  read_hdf5(file_->name, [&] {
    times_us = columns.time_us.read(first, count);
    x = columns.x.read(first, count);
    y = columns.y.read(first, count);
    polarity = columns.polarity.read(first, count);
  });
  std::vector<Event> events;
  events.reserve(times_us.size());
  EventCheck check = EventCheck::of_any_time(kDhp19Size);
  try {
    for (std::size_t i = 0; i < times_us.size(); ++i) {
      events.push_back(
          check.take({x[i], y[i], (times_us[i] - file_->start_us) * kSeconds, polarity[i]}));
    }
  } catch (const EventFault& fault) {
    throw InputError(std::string(fault.what()) + ", in " + file_->name + " (cam" +
                     std::to_string(camera) + ", event " +
                     std::to_string(first + std::ssize(events)) + ")");
  }
  return events;
}

}  // namespace eventgan
