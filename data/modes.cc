#include "data/modes.h"

#include <fmt/format.h>

#include <cmath>

#include "base/error.h"
#include "data/atomic_file.h"
#include "data/csv.h"
#include "data/formats.h"
#include "data/h5.h"

namespace unfurl::data {
namespace {

constexpr int kModesVersion = 1;
// Places that move alike but for rounding: the first of them is named.
constexpr double kAlike = 1e-9;

std::string Csv(const ModesRecord& record) {
  CsvWriter csv({{"mode", ""},
                 {"frequency", "Hz"},
                 {"place", ""},
                 {"x", "m"},
                 {"y", "m"},
                 {"dx", "m"},
                 {"dy", "m"},
                 {"dtheta", "rad"}});
  for (std::size_t m = 0; m < record.modes.size(); ++m) {
    const ModesRecord::Mode& mode = record.modes[m];
    for (std::size_t p = 0; p < record.places.size(); ++p) {
      const ModesRecord::Pose &at = record.rest[p], &d = mode.shape[p];
      std::vector<std::string> row = {std::to_string(m + 1), fmt::format("{}", mode.frequency),
                                      record.places[p]};
      for (const double v : {at[0], at[1], d[0], d[1], d[2]}) row.push_back(fmt::format("{}", v));
      csv.Row(row);
    }
  }
  return csv.text();
}

std::vector<ModesRecord::Pose> Poses(const std::vector<double>& values, std::size_t first,
                                     std::size_t count) {
  std::vector<ModesRecord::Pose> poses(count);
  for (std::size_t p = 0; p < count; ++p) {
    for (std::size_t k = 0; k < 3; ++k) poses[p][k] = values[3 * (first + p) + k];
  }
  return poses;
}

}  // namespace

std::size_t ModesRecord::MovesMost(const Mode& mode) const {
  std::size_t most = 0;
  double largest = -1.0;
  for (std::size_t p = 0; p < mode.shape.size(); ++p) {
    const double size = std::hypot(mode.shape[p][0], mode.shape[p][1]);
    if (size > largest * (1.0 + kAlike)) {
      largest = size;
      most = p;
    }
  }
  return most;
}

void WriteModes(const std::string& path, const ModesRecord& record, const Provenance& provenance) {
  if (FormatOf(path) == FileFormat::kCsv) {
    WriteTextFile(path, Csv(record));
    return;
  }
  if (FormatOf(path) != FileFormat::kHdf5) {
    throw Error("shapes cannot be written under this ending", path, "use .h5 or .csv");
  }
  std::vector<double> frequency, damping, growth, error, rest, shapes;
  for (const ModesRecord::Pose& at : record.rest) rest.insert(rest.end(), at.begin(), at.end());
  for (const ModesRecord::Mode& mode : record.modes) {
    frequency.push_back(mode.frequency);
    damping.push_back(mode.damping);
    growth.push_back(mode.growth);
    error.push_back(mode.error);
    for (const ModesRecord::Pose& d : mode.shape) shapes.insert(shapes.end(), d.begin(), d.end());
  }
  H5Writer w(path, kModesSchema, kModesVersion, provenance);
  w.Write({"/frequency", "Hz", "undamped; 0 for an unstable motion"}, frequency);
  w.Write({"/damping", "1", "ratio, to first order"}, damping);
  w.Write({"/growth", "1/s", "of unstable motions"}, growth);
  w.Write({"/error", "Hz, 1/s", "of the mesh, in frequency or growth; NaN: not known"}, error);
  w.Write({"/place", "1", "bodies, segments of beams, marks"}, record.places);
  w.Write({"/rest", "m, m, rad", "x, y, angle of each place"}, rest, {record.places.size(), 3});
  w.Write({"/shape", "m, m, rad", "dx, dy, dtheta by mode and place; largest displacement 1 m"},
          shapes, {record.modes.size(), record.places.size(), 3});
  w.Commit();
}

ModesRecord ReadModes(const std::string& path) {
  const H5Reader file(path, kModesSchema, kModesVersion);
  ModesRecord record;
  record.places = file.ReadStrings("/place");
  const std::size_t places = record.places.size();
  const std::vector<double> frequency = file.ReadDoubles("/frequency", "Hz");
  const std::vector<double> damping = file.ReadDoubles("/damping");
  const std::vector<double> growth = file.ReadDoubles("/growth", "1/s");
  // Files of before have none.
  const std::vector<double> error =
      file.Has("/error")
          ? file.ReadDoubles("/error")
          : std::vector<double>(frequency.size(), std::numeric_limits<double>::quiet_NaN());
  const std::vector<double> rest = file.ReadDoubles("/rest"), shapes = file.ReadDoubles("/shape");
  const auto expect = [&](const std::vector<double>& values, std::size_t count, const char* at) {
    if (values.size() == count) return;
    file.Fail(fmt::format("has {} numbers where {} were expected", values.size(), count), at,
              "make the file again");
  };
  expect(damping, frequency.size(), "/damping");
  expect(growth, frequency.size(), "/growth");
  expect(error, frequency.size(), "/error");
  expect(rest, 3 * places, "/rest");
  expect(shapes, 3 * places * frequency.size(), "/shape");
  record.rest = Poses(rest, 0, places);
  for (std::size_t m = 0; m < frequency.size(); ++m) {
    record.modes.push_back(
        {frequency[m], damping[m], growth[m], Poses(shapes, m * places, places), error[m]});
  }
  return record;
}

}  // namespace unfurl::data
