#include "data/trial_health.h"

#include "data/h5.h"
#include "data/tracks.h"

namespace unfurl::data {

namespace {

const std::string kLight = "/health/light/";

// The members of a change that are numbers, by their names in the file.
struct LightWhole {
  const char *name, *words;
  std::int32_t TrialLight::*member;
};
constexpr LightWhole kLightWhole[] = {
    {"kind", "0 LED, 1 gain, 2 focus, 3 all light", &TrialLight::kind},
    {"camera", "index into cameras; -1: all", &TrialLight::camera},
    {"mark", "index into marks; -1: all", &TrialLight::mark},
    {"certain", "0: something else explains it as well", &TrialLight::certain}};
struct LightReal {
  const char *name, *unit, *words;
  double TrialLight::*member;
};
constexpr LightReal kLightReal[] = {
    {"from", "s", "earliest begin", &TrialLight::from},
    {"to", "s", "latest begin", &TrialLight::to},
    {"until", "s", "when it has its size", &TrialLight::until},
    {"size", "1", "relative change of brightness or width", &TrialLight::size},
    {"sigma", "1", "standard deviation of size", &TrialLight::sigma}};

void WriteLight(const TrialHealth& health, H5Writer* file) {
  if (!health.marks.empty()) {
    file->Write({"/health/marks", "1", "marks' names"}, health.marks);
  }
  if (health.light.empty()) return;
  std::vector<std::string> words;
  for (const TrialLight& one : health.light) words.push_back(one.words);
  file->Write({kLight + "words", "1", "what changed"}, words);
  for (const LightWhole& of : kLightWhole) {
    std::vector<std::int32_t> values;
    for (const TrialLight& one : health.light) values.push_back(one.*of.member);
    file->Write({kLight + of.name, "1", of.words}, values);
  }
  for (const LightReal& of : kLightReal) {
    std::vector<double> values;
    for (const TrialLight& one : health.light) values.push_back(one.*of.member);
    file->Write({kLight + of.name, of.unit, of.words}, values);
  }
}

void ReadLight(const H5Reader& file, TrialHealth* out) {
  if (file.Has("/health/marks")) out->marks = file.ReadStrings("/health/marks");
  if (!file.Has("/health/light")) return;
  const auto refuse_unless = [&](bool good) {
    if (!good)
      file.Fail("holds changes that contradict each other", "/health/light", "make it again");
  };
  for (const std::string& words : file.ReadStrings(kLight + "words")) {
    out->light.push_back({.words = words});
  }
  for (const LightWhole& of : kLightWhole) {
    const std::vector<std::int32_t> values = file.ReadInts(kLight + of.name);
    refuse_unless(values.size() == out->light.size());
    for (std::size_t k = 0; k < values.size(); ++k) out->light[k].*of.member = values[k];
  }
  for (const LightReal& of : kLightReal) {
    const std::vector<double> values = file.ReadDoubles(kLight + of.name, of.unit);
    refuse_unless(values.size() == out->light.size());
    for (std::size_t k = 0; k < values.size(); ++k) out->light[k].*of.member = values[k];
  }
  for (const TrialLight& one : out->light) {
    refuse_unless(one.kind >= 0 && one.kind <= 3 && one.camera >= -1 && one.mark >= -1 &&
                  one.camera < static_cast<std::int32_t>(out->cameras.size()) &&
                  one.mark < static_cast<std::int32_t>(out->marks.size()));
  }
}

void WriteScatter(const TrialHealth& health, H5Writer* file) {
  const std::string group = "/health/scatter";
  file->Attribute(group, "words", health.scatter_words);
  file->Attribute(group, "unknown", health.scatter_unknown);
  file->Attribute(group, "wide", static_cast<std::int64_t>(health.scatter_wide));
  file->Attribute(group, "factor", health.scatter);
  file->Attribute(group, "sigma", health.scatter_sigma);
  file->Attribute(group, "wrong", health.wrong_words);
  file->Write({group + "/wrong_readings", "1",
               "readings left out that depart from the course of their mark, by camera"},
              health.wrong);
  file->Attribute(group, "misfit", health.misfit_words);
  file->Attribute(group, "misfit [px]", health.misfit);
  if (!health.camera_misfit.empty()) {
    file->Write({group + "/camera_misfit", "px",
                 "what readings leave over beyond noise and calibration, of its marks the most"},
                health.camera_misfit);
  }
  if (health.camera_scatter.empty()) return;
  file->Write({group + "/camera_factor", "1", "by which readings' stated sigmas were multiplied"},
              health.camera_scatter);
  file->Write({group + "/camera_sigma", "1", "standard deviation of camera_factor"},
              health.camera_scatter_sigma);
  file->Write({group + "/mark_factor", "1",
               "by which the stated sigmas of each mark's readings were multiplied, by camera"},
              health.mark_scatter);
}

void ReadScatter(const H5Reader& file, TrialHealth* out) {
  const std::string group = "/health/scatter";
  if (!file.Has(group)) {  // written before anybody looked
    out->scatter_unknown = "nobody looked";
    return;
  }
  out->scatter_words = file.StringAttribute(group, "words");
  out->scatter_unknown = file.StringAttribute(group, "unknown");
  out->scatter_wide = file.IntAttribute(group, "wide") != 0;
  out->scatter = file.DoubleAttribute(group, "factor");
  out->scatter_sigma = file.DoubleAttribute(group, "sigma");
  if (file.Has(group + "/wrong_readings")) {  // else written before anybody looked for them
    out->wrong_words = file.StringAttribute(group, "wrong");
    out->wrong = file.ReadInts(group + "/wrong_readings");
    if (out->wrong.size() != out->cameras.size()) {
      file.Fail("counts readings of other cameras", group, "make the file again");
    }
  }
  if (file.Has(group + "/camera_misfit")) {
    out->misfit_words = file.StringAttribute(group, "misfit");
    out->misfit = file.DoubleAttribute(group, "misfit [px]");
    out->camera_misfit = file.ReadDoubles(group + "/camera_misfit", "px");
    if (out->camera_misfit.size() != out->cameras.size()) {
      file.Fail("holds a misfit of other cameras", group, "make the file again");
    }
  }
  if (!file.Has(group + "/camera_factor")) return;
  out->camera_scatter = file.ReadDoubles(group + "/camera_factor", "1");
  out->camera_scatter_sigma = file.ReadDoubles(group + "/camera_sigma", "1");
  if (out->camera_scatter.size() != out->cameras.size() ||
      out->camera_scatter_sigma.size() != out->cameras.size()) {
    file.Fail("holds factors of other cameras", group, "make the file again");
  }
  if (!file.Has(group + "/mark_factor")) return;  // written before marks were looked at
  out->mark_scatter = file.ReadMatrix(group + "/mark_factor", "1");
  if (out->mark_scatter.cols() != static_cast<Eigen::Index>(out->cameras.size())) {
    file.Fail("holds factors of other cameras", group, "make the file again");
  }
}

}  // namespace

void WriteTrialHealth(const TrialHealth& health, H5Writer* file) {
  const std::vector<std::string> by = {"/health/t", "/health/cameras"};
  file->Attribute("/health", "unknown", health.unknown);
  file->Attribute("/health", "corrected", static_cast<std::int64_t>(health.corrected));
  file->Write({"/health/cameras", "1", "cameras' names"}, health.cameras);
  file->Write({"/health/t", "s", "middles of the slices of time"}, health.t);
  file->Write({"/health/offset", "px", "readings less what the other cameras predict", by},
              health.offset_px);
  file->Write({"/health/sigma", "px", "standard deviation of the offset by its scatter", by},
              health.sigma_px);
  file->Write({"/health/gain", "1", "brightness of spots over the trial's median", by},
              health.gain);
  file->Write({"/health/width", "px", "width (sigma) of spots", by}, health.width_px);
  const std::string vouching = "/health/vouching";
  file->Attribute(vouching, "unvouched", health.unvouched);
  file->Attribute(vouching, "distances", health.distances);
  file->Attribute(vouching, "distances_kept", static_cast<std::int64_t>(health.distances_kept));
  WriteLight(health, file);
  WriteScatter(health, file);
  const std::string faults = "/health/faults/";
  if (health.words.empty()) return;
  file->Write({faults + "words", "1", "what is wrong"}, health.words);
  file->Write({faults + "kind", "1", "0 moved, 1 drifting, 2 late"}, health.kind);
  file->Write({faults + "camera", "1", "index into cameras"}, health.camera);
  file->Write({faults + "certain", "1", "0: it may be another camera"}, health.certain);
  file->Write({faults + "from", "s", "earliest begin; -inf: before the record"}, health.from);
  file->Write({faults + "to", "s", "latest begin"}, health.to);
  file->Write({faults + "size", "px, lines", "offset of a move or drift, lag"}, health.size);
  file->Write({faults + "sigma", "px, lines", "standard deviation of size"}, health.sigma);
  file->Write({faults + "slope", "px/s", "of a drift"}, health.slope);
  file->Write({faults + "slope_sigma", "px/s", "its standard deviation"}, health.slope_sigma);
  file->Write({faults + "at", "s", "when a drift has its size"}, health.at);
}

TrialHealth ReadTrialHealth(const std::string& path) {
  const H5Reader file(path, kTracksSchema, kTracksVersion);
  TrialHealth out;
  if (!file.Has("/health/cameras")) return out;
  out.unknown = file.StringAttribute("/health", "unknown");
  out.corrected = file.IntAttribute("/health", "corrected") != 0;
  out.cameras = file.ReadStrings("/health/cameras");
  out.t = file.ReadDoubles("/health/t", "s");
  out.offset_px = file.ReadMatrix("/health/offset", "px");
  out.sigma_px = file.ReadMatrix("/health/sigma", "px");
  out.gain = file.ReadMatrix("/health/gain", "1");
  out.width_px = file.ReadMatrix("/health/width", "px");
  for (const Eigen::MatrixXd* one : {&out.offset_px, &out.sigma_px, &out.gain, &out.width_px}) {
    if (one->rows() == static_cast<Eigen::Index>(out.t.size()) &&
        one->cols() == static_cast<Eigen::Index>(out.cameras.size())) {
      continue;
    }
    file.Fail("holds series of different lengths", "/health", "make the file again");
  }
  const std::string vouching = "/health/vouching";
  if (file.Has(vouching)) {  // else written before anybody asked
    out.unvouched = file.StringAttribute(vouching, "unvouched");
    out.distances = file.StringAttribute(vouching, "distances");
    out.distances_kept = file.IntAttribute(vouching, "distances_kept") != 0;
  }
  ReadLight(file, &out);
  ReadScatter(file, &out);
  if (!file.Has("/health/faults")) return out;
  const std::string faults = "/health/faults/";
  out.words = file.ReadStrings(faults + "words");
  out.kind = file.ReadInts(faults + "kind");
  out.camera = file.ReadInts(faults + "camera");
  out.certain = file.ReadInts(faults + "certain");
  out.from = file.ReadDoubles(faults + "from", "s");
  out.to = file.ReadDoubles(faults + "to", "s");
  out.size = file.ReadDoubles(faults + "size");
  out.sigma = file.ReadDoubles(faults + "sigma");
  out.slope = file.ReadDoubles(faults + "slope", "px/s");
  out.slope_sigma = file.ReadDoubles(faults + "slope_sigma", "px/s");
  out.at = file.ReadDoubles(faults + "at", "s");
  const std::size_t n = out.words.size();
  for (const auto* one :
       {&out.from, &out.to, &out.size, &out.sigma, &out.slope, &out.slope_sigma, &out.at}) {
    if (one->size() != n)
      file.Fail("holds faults of different lengths", "/health", "make it again");
  }
  if (out.kind.size() != n || out.camera.size() != n || out.certain.size() != n) {
    file.Fail("holds faults of different lengths", "/health", "make it again");
  }
  for (const std::int32_t camera : out.camera) {
    if (camera >= 0 && static_cast<std::size_t>(camera) < out.cameras.size()) continue;
    file.Fail("names a camera that is not there", "/health/faults/camera", "make the file again");
  }
  return out;
}

}  // namespace unfurl::data
