#include "data/scene.h"

#include <cmath>
#include <limits>
#include <map>
#include <numbers>

#include "base/error.h"
#include "base/text.h"
#include "data/toml.h"

namespace unfurl::data {
namespace {

constexpr int kMostSegments = 1'000'000;
constexpr double kLongest = 1e7;  // of a run [s]

std::array<double, 2> Pair(const std::vector<double>& v) { return {v[0], v[1]}; }

std::optional<std::array<double, 3>> TripleOrNone(const TomlTable& table, const char* key) {
  if (!table.Has(key)) return std::nullopt;
  const std::vector<double> v = table.Numbers(key, 3);
  return std::array<double, 3>{v[0], v[1], v[2]};
}

// Names are used in columns ("hub.x") and in ends ("beam1.start").
void CheckName(const TomlTable& table, const std::string& name) {
  if (name.empty() || name == "ground" || name == "t" || name.find('.') != std::string::npos) {
    table.Fail("", "\"" + name + "\" cannot be a name",
               "use another than \"ground\" or \"t\", without a dot");
  }
}

class SceneReader {
 public:
  explicit SceneReader(const TomlTable& root) : root_(root) {}

  Scene Read(const std::string& path) {
    scene_.path = path;
    const TomlTable head = root_.Table("scene");
    scene_.name = head.String("name");
    scene_.duration = head.Number("duration", TomlRange{0.0, kLongest, true, false});
    ReadBodies();
    ReadBeams();
    ReadWelds();
    ReadContacts();
    ReadJoints();
    ReadMarks();
    ReadFields();
    root_.RefuseUnknownKeys();  // first: a misspelt [body] is what left the scene empty
    if (scene_.bodies.empty() && scene_.beams.empty()) {
      root_.Fail("", "the scene has neither bodies nor beams", "add a [body.NAME] or [beam.NAME]");
    }
    return std::move(scene_);
  }

 private:
  // Bodies, beams and joints share the columns NAME.x, NAME.theta: one set of names.
  void Register(const TomlTable& table, const std::string& name) {
    CheckName(table, name);
    if (!names_.emplace(name, table.Where()).second) {
      table.Fail("", "the name \"" + name + "\" is already taken by " + names_[name],
                 "give each body, beam, joint and mark a name of its own");
    }
  }

  void ReadBodies() {
    for (const auto& [name, table] : root_.NamedTables("body")) {
      Register(table, name);
      SceneBody body;
      body.name = name;
      body.mass = table.Number("mass", kPositive);
      body.inertia = table.Number("inertia", kPositive);
      body.pose = TripleOrNone(table, "pose");
      body.velocity = TripleOrNone(table, "velocity");
      body.where = table.Where();
      ends_[name] = {SceneEnd::Kind::kBody, static_cast<int>(scene_.bodies.size()), {0, 0}};
      scene_.bodies.push_back(body);
    }
  }

  void ReadBeams() {
    for (const auto& [name, table] : root_.NamedTables("beam")) {
      Register(table, name);
      SceneBeam beam;
      beam.name = name;
      beam.length = table.Number("length", kPositive);
      beam.mass = table.Number("mass", kPositive);
      beam.segments = table.IntegerOr("segments", 8, 1, kMostSegments);
      beam.axial_elastic = table.ChoiceOr("axial", "rigid", {"rigid", "elastic"}) == "elastic";
      beam.damping = table.NumberOr("damping", 0.0, kNonNegative);
      beam.gradient_form =
          table.ChoiceOr("form", "gradient", {"gradient", "printed"}) == "gradient";
      ReadSection(table, &beam);
      beam.pose = TripleOrNone(table, "pose");
      beam.velocity = TripleOrNone(table, "velocity");
      beam.where = table.Where();
      const int index = static_cast<int>(scene_.beams.size());
      ends_[name + ".start"] = {SceneEnd::Kind::kBeamStart, index, {0, 0}};
      ends_[name + ".end"] = {SceneEnd::Kind::kBeamEnd, index, {0, 0}};
      scene_.beams.push_back(beam);
    }
  }

  static void ReadSection(const TomlTable& table, SceneBeam* beam) {
    const bool by_modulus = table.Has("E");
    const double E = by_modulus ? table.Number("E", kPositive) : 0.0;
    if (table.Has("EI")) {
      if (table.Has("I")) table.Fail("I", "EI and I are both given", "remove one of them");
      beam->EI = table.Number("EI", kPositive);
    } else if (by_modulus) {
      beam->EI = E * table.Number("I", kPositive);
    } else {
      table.Fail("EI", "the beam has no bending stiffness", "give EI, or E and I");
    }
    if (table.Has("EA")) {
      beam->EA = table.Number("EA", kPositive);
    } else if (by_modulus && table.Has("area")) {
      beam->EA = E * table.Number("area", kPositive);
    } else if (by_modulus && table.Has("density")) {
      beam->EA = E * beam->mass / (table.Number("density", kPositive) * beam->length);
    } else if (beam->axial_elastic) {
      table.Fail("EA", "axial = \"elastic\" needs an axial stiffness",
                 "give EA, or E with area or density");
    }
  }

  SceneEnd ReadEnd(const TomlTable& table, const char* key, const char* point_key) {
    const std::string name = table.String(key);
    SceneEnd end;
    if (name != "ground") {
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
    if (table.Has(point_key)) {
      if (end.kind == SceneEnd::Kind::kBeamStart || end.kind == SceneEnd::Kind::kBeamEnd) {
        table.Fail(point_key, "a beam's end has no point of its own", "remove the key");
      }
      end.point = Pair(table.Numbers(point_key, 2));
    }
    return end;
  }

  void ReadWelds() {
    for (const auto& [name, table] : root_.NamedTables("weld")) {
      CheckName(table, name);
      SceneWeld weld;
      weld.name = name;
      weld.inner = ReadEnd(table, "inner", "inner_point");
      weld.outer = ReadEnd(table, "outer", "outer_point");
      weld.angle = table.NumberOr("angle", 0.0);
      weld.where = table.Where();
      scene_.welds.push_back(weld);
    }
  }

  void ReadContacts() {
    for (const auto& [name, table] : root_.NamedTables("contact")) {
      CheckName(table, name);
      SceneContact c;
      c.name = name;
      if (table.Has("K")) {
        c.K = table.Number("K", kPositive);
      } else {
        constexpr TomlRange kPoisson{-1.0, 0.5, true, false};
        const double infinity = std::numeric_limits<double>::infinity();
        const double radius_i = table.Number("radius_i", kPositive);
        const double radius_j =
            table.Has("radius_j") ? table.Number("radius_j", kPositive) : infinity;
        c.K = HertzStiffness(radius_i, radius_j, table.Number("modulus_i", kPositive),
                             table.Number("poisson_i", kPoisson),
                             table.Number("modulus_j", kPositive),
                             table.Number("poisson_j", kPoisson));
      }
      if (table.Has("C")) {
        c.C = table.Number("C", kNonNegative);
      } else {
        c.C = ContactDamping(table.Number("mass", kPositive),
                             table.Number("linear_stiffness", kPositive),
                             table.Number("restitution", TomlRange{0.0, 1.0, true, false}));
      }
      c.Q = table.Number("Q", kNonNegative);
      c.epsilon = table.Number("epsilon", kPositive);
      c.never_pulls = table.ChoiceOr("pull", "never", {"never", "printed"}) == "never";
      c.where = table.Where();
      contacts_[name] = static_cast<int>(scene_.contacts.size());
      scene_.contacts.push_back(c);
    }
  }

  void ReadJoints() {
    for (const auto& [name, table] : root_.NamedTables("joint")) {
      Register(table, name);
      SceneJoint joint;
      joint.name = name;
      joint.inner = ReadEnd(table, "inner", "inner_point");
      joint.outer = ReadEnd(table, "outer", "outer_point");
      joint.sign = table.IntegerOr("sign", 1, -1, 1);
      if (joint.sign == 0.0) table.Fail("sign", "the sign is 0", "use 1 or -1");
      joint.zero_angle = table.NumberOr("zero_angle", 0.0);
      joint.theta = table.NumberOr("theta", 0.0);
      joint.theta_rate = table.NumberOr("theta_rate", 0.0);
      joint.hang_theta = table.NumberOr("hang_theta", 0.0);
      if (const auto spring = table.TableOrNone("spring")) {
        joint.spring = SceneSpring{spring->Number("stiffness", kPositive),
                                   spring->NumberOr("preload", 0.0), spring->Where()};
      }
      if (const auto latch = table.TableOrNone("latch")) joint.latch = ReadLatch(*latch);
      joint.where = table.Where();
      scene_.joints.push_back(joint);
    }
  }

  SceneLatch ReadLatch(const TomlTable& table) {
    SceneLatch latch;
    latch.theta_a = table.Number("theta_a");
    latch.theta_b = table.Number("theta_b");
    if (latch.theta_a + latch.theta_b < 0.0) {
      table.Fail("theta_b", "theta_a + theta_b is negative: the upper stop lies below the lower",
                 "make theta_a + theta_b zero or more");
    }
    latch.lever = table.Number("lever", kPositive);
    const std::string contact = table.String("contact");
    const auto found = contacts_.find(contact);
    if (found == contacts_.end()) {
      std::vector<std::string> known;
      for (const auto& [n, i] : contacts_) known.push_back(n);
      const std::string nearest = NearestName(contact, known);
      table.Fail("contact", "there is no contact \"" + contact + "\"",
                 nearest.empty() ? "add a [contact." + contact + "]"
                                 : "did you mean \"" + nearest + "\"?");
    }
    latch.contact = found->second;
    latch.where = table.Where();
    return latch;
  }

  void ReadMarks() {
    for (const auto& [name, table] : root_.NamedTables("mark")) {
      Register(table, name);
      scene_.marks.push_back({name, ReadEnd(table, "on", "point"), table.Where()});
    }
  }

  void ReadFields() {
    if (const auto gravity = root_.TableOrNone("gravity")) {
      scene_.gravity = SceneGravity{Pair(gravity->Numbers("acceleration", 2))};
    }
    if (const auto suspension = root_.TableOrNone("suspension")) {
      scene_.suspension = SceneSuspension{suspension->Number("length", kPositive),
                                          suspension->NumberOr("gravity", 9.81, kPositive)};
    }
  }

  TomlTable root_;
  Scene scene_;
  std::map<std::string, std::string> names_;
  std::map<std::string, SceneEnd> ends_;
  std::map<std::string, int> contacts_;
};

}  // namespace

Scene ReadScene(const std::string& path, const std::vector<std::string>& overrides) {
  return SceneReader(LoadToml(path, overrides)).Read(path);
}

Scene ParseScene(const std::string& text, const std::string& name) {
  return SceneReader(ParseToml(text, name)).Read(name);
}

double HertzStiffness(double radius_i, double radius_j, double modulus_i, double poisson_i,
                      double modulus_j, double poisson_j) {
  const double pi = std::numbers::pi;
  const double h_i = (1.0 - poisson_i * poisson_i) / (pi * modulus_i);
  const double h_j = (1.0 - poisson_j * poisson_j) / (pi * modulus_j);
  const double radius = 1.0 / (1.0 / radius_i + 1.0 / radius_j);
  return 4.0 / (3.0 * pi * (h_i + h_j)) * std::sqrt(radius);
}

double ContactDamping(double mass, double stiffness, double restitution) {
  const double log_e = std::log(restitution);
  const double ratio =
      std::sqrt(log_e * log_e / (log_e * log_e + std::numbers::pi * std::numbers::pi));
  return 2.0 * mass * std::sqrt(stiffness / mass) * ratio;
}

}  // namespace unfurl::data
