#include "data/scene_reader.h"

#include <fmt/format.h>

#include "base/text.h"
#include "data/toml_kind.h"

namespace unfurl::data {
namespace {

constexpr double kSceneReaderLongest = 1e7;  // of a run [s]
// Looking closely at an expression takes milliseconds: not at each of a hundred thousand.
constexpr int kLookedAtClosely = 1000;
constexpr int kFineCells = 4096, kCoarseCells = 16;

}  // namespace

void RefuseKeys(const TomlTable& table, std::initializer_list<const char*> keys,
                const std::string& why) {
  for (const char* key : keys) {
    if (table.Has(key)) table.Fail(key, why, "remove the key");
  }
}

Scene SceneReader::Read(const std::string& path) {
  scene_.path = path;
  scene_.files = root_.Files();
  const TomlTable head = root_.Table("scene");
  scene_.name = head.String("name");
  scene_.duration = head.Number("duration", TomlRange{0.0, kSceneReaderLongest, true, false});
  ReadBodies();
  ReadBeams();
  ReadWelds();
  ReadContacts();
  ReadJoints();
  ReadLinearSprings();
  ReadForces();
  ReadMarks();
  ReadSensors();
  ReadWatches();
  ReadFields();
  ReadSolver();
  root_.RefuseUnknownKeys();  // first: a misspelt [body] is what left the scene empty
  if (scene_.bodies.empty() && scene_.beams.empty()) {
    root_.Fail("", "the scene has neither bodies nor beams", "add a [body.NAME] or [beam.NAME]");
  }
  return std::move(scene_);
}

// Names are used in columns ("hub.x") and in ends ("beam1.start").
void SceneReader::CheckName(const TomlTable& table, const std::string& name) {
  if (name.empty() || name == "ground" || name == "t" || name.find('.') != std::string::npos) {
    table.Fail("", "\"" + name + "\" cannot be a name",
               "use another than \"ground\" or \"t\", without a dot");
  }
}

void SceneReader::Register(const TomlTable& table, const std::string& name, Thing thing) {
  CheckName(table, name);
  if (!names_.emplace(name, table.Where()).second) {
    table.Fail("", "the name \"" + name + "\" is already taken by " + names_[name],
               "give each body, beam, joint, spring, mark and sensor a name of its own");
  }
  things_[name] = thing;
}

SceneEnd SceneReader::ReadEnd(const TomlTable& table, const char* key, const char* point_key,
                              const char* at_key) const {
  const std::string name = table.String(key);
  SceneEnd end;
  if (const auto beam = beams_.find(name); beam != beams_.end()) {
    if (at_key == nullptr || !table.Has(at_key)) {
      table.Fail(key, "\"" + name + "\" is a beam, not an end of it",
                 "name " + name + ".start or " + name + ".end" +
                     (at_key == nullptr ? "" : fmt::format(", or give {} from 0 to 1", at_key)));
    }
    end.kind = SceneEnd::Kind::kAlongBeam;
    end.index = beam->second;
    end.at = table.Number(at_key, TomlRange{0.0, 1.0});
    if (end.at == 0.0) end.kind = SceneEnd::Kind::kBeamStart;
    if (end.at == 1.0) end.kind = SceneEnd::Kind::kBeamEnd;
  } else if (name != "ground") {
    const auto found = ends_.find(name);
    if (found == ends_.end()) {
      std::vector<std::string> known{"ground"};
      for (const auto& [n, e] : ends_) known.push_back(n);
      const std::string nearest = NearestName(name, known);
      table.Fail(key, "there is no body or beam end \"" + name + "\"",
                 nearest.empty() ? "name a body, a beam as NAME.start or NAME.end, or ground"
                                 : "did you mean \"" + nearest + "\"?");
    }
    end = found->second;
  }
  const bool on_beam = end.kind != SceneEnd::Kind::kGround && end.kind != SceneEnd::Kind::kBody;
  if (at_key != nullptr && !beams_.contains(name) && table.Has(at_key)) {
    table.Fail(at_key, "\"" + name + "\" is not a whole beam", "remove the key, or name a beam");
  }
  if (table.Has(point_key)) {
    if (on_beam) {
      table.Fail(point_key, "a beam's end has no point of its own", "remove the key");
    }
    const std::vector<double> point = table.Numbers(point_key, 2);
    end.point = {point[0], point[1]};
  }
  return end;
}

TimeFunction SceneReader::ReadFunction(const TomlTable& table, const char* key, int derivatives) {
  const std::string where = table.Where(key);
  if (table.IsString(key)) {
    TimeFunction function = TimeFunction::Expression(table.String(key), where);
    function.CheckFinite(scene_.duration, derivatives,
                         functions_++ < kLookedAtClosely ? kFineCells : kCoarseCells);
    return function;
  }
  if (table.IsTable(key)) {
    const TomlTable points = table.Table(key);
    std::vector<double> t = points.Numbers("t", -1), value = points.Numbers("value", -1);
    const bool cubic = points.ChoiceOr("interpolation", "cubic", {"cubic", "linear"}) == "cubic";
    if (derivatives > 1) {
      if (!cubic) {
        points.Fail("interpolation", "straight lines have no acceleration where they meet",
                    "use \"cubic\", or give the rate");
      }
      if (!t.empty() && (t.front() > 0.0 || t.back() < scene_.duration)) {
        points.Fail(
            "t",
            fmt::format("the table covers {} to {} s, the run 0 to {} s: the rate would jump",
                        t.front(), t.back(), scene_.duration),
            "cover the run");
      }
    }
    return TimeFunction::Table(std::move(t), std::move(value), cubic, where);
  }
  if (table.Has(key) && !table.IsNumber(key)) {
    table.Fail(key, "is not a function of time",
               "give a number, an expression \"...\" of t, or {t = [..], value = [..]}");
  }
  return TimeFunction(table.Number(key));
}

Scene ReadScene(const TomlTable& root, const std::string& name) {
  return SceneReader(root).Read(name);
}

Scene ReadScene(const std::string& path, const std::vector<std::string>& overrides) {
  const TomlTable root = LoadToml(path, overrides);
  return ReadAsKind(root, "scene", [&] { return ReadScene(root, path); });
}

Scene ParseScene(const std::string& text, const std::string& name) {
  return ReadScene(ParseToml(text, name), name);
}

}  // namespace unfurl::data
