#include "data/lab.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "data/toml.h"
#include "data/toml_kind.h"

namespace unfurl::data {

namespace {

Eigen::Vector3d Vector(const TomlTable& table, const char* key) {
  const std::vector<double> v = table.Numbers(key, 3);
  return {v[0], v[1], v[2]};
}

std::array<double, 2> Pair(const TomlTable& table, const char* key) {
  const std::vector<double> v = table.Numbers(key, 2);
  return {v[0], v[1]};
}

// The keys of a table of one camera's own; what it leaves out is as in `common`. Without `common`
// every key is required, but those that have a default.
class OwnTable {
 public:
  OwnTable(const TomlTable& table, bool own) : t_(table), own_(own) {}
  double Number(const char* key, double common, TomlRange range) const {
    return own_ ? t_.NumberOr(key, common, range) : t_.Number(key, range);
  }
  int Integer(const char* key, int common, int low, int high) const {
    return own_ ? t_.IntegerOr(key, common, low, high) : t_.Integer(key, low, high);
  }
  bool Bool(const char* key, bool common) const {
    return own_ ? t_.BoolOr(key, common) : t_.Bool(key);
  }
  std::string Choice(const char* key, const std::string& common,
                     const std::vector<std::string>& allowed) const {
    return own_ ? t_.ChoiceOr(key, common, allowed) : t_.Choice(key, allowed);
  }

 private:
  const TomlTable& t_;
  bool own_;
};

void CheckGlass(const TomlTable& t, const LabLens& lens) {
  const double half = 0.5 * lens.width;
  if (half >= lens.radius) {
    t.Fail("width", "the lens is wider than its cylinder", "give a width below twice the radius");
  }
  const double sag = lens.radius - std::sqrt(lens.radius * lens.radius - half * half);
  if (lens.thickness <= (lens.curved == "both" ? 2.0 : 1.0) * sag) {
    t.Fail("thickness", "the lens has no edge left at this width", "make it thicker or narrower");
  }
}

LabLens ReadLens(const TomlTable& t, const LabLens* common = nullptr) {
  LabLens lens = common != nullptr ? *common : LabLens{};
  std::vector<std::string> models = {"glass"};
  for (const LensNames& model : kLensModels) models.emplace_back(model.name);
  const std::string model = t.ChoiceOr("model", lens.model, models);
  const OwnTable own(t, common != nullptr && model == lens.model);
  lens.model = model;
  lens.focus_distance = common != nullptr
                            ? t.NumberOr("focus_distance", lens.focus_distance, kPositive)
                            : t.Number("focus_distance", kPositive);
  if (lens.traced()) {
    lens.index = own.Number("index", lens.index, {1.0, 4.0, true, false});
    lens.radius = own.Number("radius", lens.radius, kPositive);
    lens.thickness = own.Number("thickness", lens.thickness, kPositive);
    lens.curved = own.Choice("curved", lens.curved, {"back", "front", "both"});
    lens.width = own.Number("width", lens.width, kPositive);
    lens.length = own.Number("length", lens.length, kPositive);
    CheckGlass(t, lens);
    return lens;
  }
  lens.focal_length = own.Number("focal_length", lens.focal_length, kPositive);
  lens.centres = own.Number("centres", lens.centres, kNonNegative);
  lens.spot = own.Number("spot", lens.spot, kPositive);
  const auto& names = NamesOf(*FindLensModel(lens.model)).terms;
  const int most = static_cast<int>(
      std::count_if(names.begin(), names.end(), [](const char* name) { return *name != '\0'; }));
  const std::vector<double> terms = t.NumbersOr("terms", {}, -1);
  if (static_cast<int>(terms.size()) > most) {
    t.Fail("terms", fmt::format("holds {} numbers", terms.size()),
           fmt::format("the {} lens has {} terms", lens.model, most));
  }
  if (t.Has("terms")) {
    lens.terms.fill(0.0);
    std::copy(terms.begin(), terms.end(), lens.terms.begin());
  }
  return lens;
}

LabSlit ReadSlit(const TomlTable& t) {
  return {.width = t.Number("width", kPositive),
          .length = t.Number("length", kPositive),
          .distance = t.Number("distance", kPositive)};
}

LabSensor ReadSensor(const TomlTable& t, const LabSensor* common = nullptr) {
  LabSensor s = common != nullptr ? *common : LabSensor{};
  const OwnTable own(t, common != nullptr);
  LineFormat& f = s.format;
  f.sensor = t.StringOr("name", f.sensor);
  f.dummy = t.IntegerOr("dummy", f.dummy, 0, 1000);
  f.dark = t.IntegerOr("dark", f.dark, 1, 1000);
  f.active = t.IntegerOr("active", f.active, 16, 100000);
  f.dark_after = t.IntegerOr("dark_after", f.dark_after, 0, 1000);
  f.parity = t.IntegerOr("parity", f.parity, 0, 1000);
  f.pitch = t.NumberOr("pitch", f.pitch, kPositive);
  f.bits = own.Integer("bits", f.bits, 8, 16);
  s.full_well = own.Number("full_well", s.full_well, kPositive);
  s.shot_noise = own.Bool("shot_noise", s.shot_noise);
  s.read_noise = own.Number("read_noise", s.read_noise, kNonNegative);
  s.dark_level = own.Number("dark_level", s.dark_level, kNonNegative);
  if (s.dark_level >= 0.5 * s.full_well) {
    t.Fail("dark_level", "the dark level takes half of the full scale or more",
           "give electrons well below full_well");
  }
  s.dark_drift = t.NumberOr("dark_drift", s.dark_drift, kNonNegative);
  s.dark_drift_period = t.NumberOr("dark_drift_period", s.dark_drift_period, kPositive);
  s.blur = own.Number("blur", s.blur, kPositive);
  s.odd_gain = t.NumberOr("odd_gain", s.odd_gain, {-0.5, 0.5});
  s.odd_offset = t.NumberOr("odd_offset", s.odd_offset, {-0.2 * s.full_well, 0.2 * s.full_well});
  s.nonuniformity = t.NumberOr("nonuniformity", s.nonuniformity, {0.0, 0.2});
  s.dark_nonuniformity = t.NumberOr("dark_nonuniformity", s.dark_nonuniformity, kNonNegative);
  s.blooming = t.NumberOr("blooming", s.blooming, {0.0, 1.0});
  s.residual = t.NumberOr("residual", s.residual, {0.0, 0.3});
  f.electrons_per_count = s.full_well / f.full_scale();
  f.read_noise_counts = s.read_noise / f.electrons_per_count;
  return s;
}

// A unit vector.
Eigen::Vector3d Direction(const TomlTable& t, const char* key) {
  const Eigen::Vector3d v = Vector(t, key);
  if (v.norm() < 1e-9) t.Fail(key, "is no direction", "give a vector that is not zero");
  return v.normalized();
}

LabLed ReadLed(const TomlTable& t) {
  LabLed led{.peak = t.Number("peak", kPositive),
             .flash = t.Number("flash", kPositive),
             .survey_flash = t.Number("survey_flash", kPositive)};
  // A cosine to some power is half somewhere short of a right angle.
  led.half_angle = t.NumberOr("half_angle", 0.0, {0.0, 1.55});
  if (t.Has("axis")) led.axis = Direction(t, "axis");
  return led;
}

LabAmbient ReadAmbient(const TomlTable& t) {
  return {.level = t.Number("level", kNonNegative),
          .slope = t.NumberOr("slope", 0.0, {-1.0, 1.0}),
          .flicker = t.NumberOr("flicker", 0.0, {0.0, 1.0}),
          .frequency = t.NumberOr("frequency", 100.0, kPositive)};
}

LabLamp ReadLamp(const TomlTable& t) {
  return {.position = Vector(t, "position"),
          .brightness = t.Number("brightness", kPositive),
          .flicker = t.NumberOr("flicker", 0.0, {0.0, 1.0}),
          .frequency = t.NumberOr("frequency", 100.0, kPositive)};
}

LabDisc ReadDisc(const TomlTable& t) {
  return {.centre = Vector(t, "centre"),
          .normal = Direction(t, "normal"),
          .radius = t.Number("radius", kPositive)};
}

LabOccluder ReadOccluder(const TomlTable& t) {
  constexpr double kEver = 1e9;  // [s]
  LabOccluder o{
      .disc = ReadDisc(t), .from = t.NumberOr("from", -kEver), .until = t.NumberOr("until", kEver)};
  if (o.until < o.from) t.Fail("until", "lies before `from`", "give a later time");
  return o;
}

LabStrobe ReadStrobe(const TomlTable& t, const LabLed& led) {
  LabStrobe s;
  s.line_rate = t.Number("line_rate", kPositive);
  s.slots = t.Strings("slots");
  if (s.slots.empty()) t.Fail("slots", "no slot", R"(list mark names and "dark")");
  if (std::count(s.slots.begin(), s.slots.end(), kDarkSlot) == 0) {
    t.Fail("slots", "no dark slot", R"(add "dark": the background is taken from it)");
  }
  s.lead = Pair(t, "lead");
  if (s.lead[0] < 0.0 || s.lead[1] < s.lead[0]) {
    t.Fail("lead", "not a range of times", "give [shortest, longest] in s, not negative");
  }
  s.clock_drift = t.NumberOr("clock_drift", 0.0, {-0.01, 0.01});
  if (led.flash * s.line_rate > 1.0) {
    t.Fail("line_rate", "a flash is longer than a line", "lower line_rate or led.flash");
  }
  return s;
}

LabMounting ReadMounting(const TomlTable& t) {
  const TomlRange angle{0.0, 0.2};
  return {.position = t.Number("position", kNonNegative),
          .rotation = t.Number("rotation", angle),
          .sensor_shift = t.Number("sensor_shift", kNonNegative),
          .sensor_roll = t.Number("sensor_roll", angle),
          .sensor_tilt = t.Number("sensor_tilt", angle),
          .lens_decentre = t.Number("lens_decentre", kNonNegative)};
}

LabCamera ReadCamera(const std::string& name, const TomlTable& t) {
  LabCamera camera{
      .name = name, .position = Vector(t, "position"), .look_at = Vector(t, "look_at")};
  camera.roll = t.Number("roll");
  const Eigen::Vector3d sight = camera.look_at - camera.position;
  if (sight.norm() < 1e-6) {
    t.Fail("look_at", "the camera looks at itself", "give a point in front of it");
  }
  if (sight.tail<2>().norm() < 1e-6 * sight.norm()) {
    t.Fail("look_at", "the optical axis lies along x, so that roll has no reference",
           "move position or look_at sideways by a millimetre");
  }
  return camera;
}

}  // namespace

namespace {

Lab ReadLabFrom(const TomlTable& root, const std::string& path) {
  Lab lab;
  lab.path = path;
  lab.seed = static_cast<std::uint64_t>(root.Integer("seed", 0, 2147483647));
  const TomlTable volume = root.Table("volume");
  lab.volume_low = Vector(volume, "low");
  lab.volume_high = Vector(volume, "high");
  if (!(lab.volume_low.array() < lab.volume_high.array()).all()) {
    volume.Fail("high", "the volume is empty", "give a corner above `low` in x, y and z");
  }
  lab.lens = ReadLens(root.Table("lens"));
  lab.slit = ReadSlit(root.Table("slit"));
  lab.sensor = ReadSensor(root.Table("sensor"));
  lab.led = ReadLed(root.Table("led"));
  lab.strobe = ReadStrobe(root.Table("strobe"), lab.led);
  lab.mounting = ReadMounting(root.Table("mounting"));
  const TomlTable model = root.Table("model");
  lab.model.position = Vector(model, "position");
  lab.model.yaw = model.Number("yaw");
  lab.model.tilt = Pair(model, "tilt");
  lab.survey.sigma = root.Table("survey").Number("sigma", kPositive);
  if (const auto flat = root.TableOrNone("flat_field")) {
    lab.flat_field.lines = flat->Integer("lines", 1, 100000);
    lab.flat_field.level = flat->Number("level", {0.01, 0.95});
  }
  if (const auto ambient = root.TableOrNone("ambient")) lab.ambient = ReadAmbient(*ambient);
  for (const auto& [name, table] : root.NamedTables("lamp")) lab.lamps.push_back(ReadLamp(table));
  for (const auto& [name, table] : root.NamedTables("reflection")) {
    lab.reflections.push_back({ReadDisc(table), table.Number("reflectance", {0.0, 1.0})});
  }
  for (const auto& [name, table] : root.NamedTables("occluder")) {
    lab.occluders.push_back(ReadOccluder(table));
  }
  for (const auto& [name, table] : root.NamedTables("camera")) {
    lab.cameras.push_back(ReadCamera(name, table));
    LabCamera& camera = lab.cameras.back();
    if (const auto own = table.TableOrNone("lens")) camera.lens = ReadLens(*own, &lab.lens);
    if (const auto own = table.TableOrNone("sensor")) camera.sensor = ReadSensor(*own, &lab.sensor);
  }
  if (lab.cameras.empty()) root.Fail("camera", "no camera", "add a table [camera.NAME]");
  root.RefuseUnknownKeys();
  return lab;
}

}  // namespace

Lab ReadLab(const std::string& path, const std::vector<std::string>& overrides) {
  const TomlTable root = LoadToml(path, overrides);
  return ReadAsKind(root, "lab", [&] { return ReadLabFrom(root, path); });
}

}  // namespace unfurl::data
