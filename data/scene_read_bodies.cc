// Bodies, beams and welds.
#include "data/scene_reader.h"

namespace unfurl::data {
namespace {

std::optional<std::array<double, 3>> TripleOrNone(const TomlTable& table, const char* key) {
  if (!table.Has(key)) return std::nullopt;
  const std::vector<double> v = table.Numbers(key, 3);
  return std::array<double, 3>{v[0], v[1], v[2]};
}

}  // namespace

void SceneReader::ReadBodies() {
  for (const auto& [name, table] : root_.NamedTables("body")) {
    Register(table, name, Thing::kBody);
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

void SceneReader::ReadBeams() {
  for (const auto& [name, table] : root_.NamedTables("beam")) {
    Register(table, name, Thing::kBeam);
    SceneBeam beam;
    beam.name = name;
    beam.length = table.Number("length", kPositive);
    beam.mass = table.Number("mass", kPositive);
    // Both models' keys may stand side by side, so that one word changes the model.
    beam.model = table.ChoiceOr("model", "segments", {"segments", "kirchhoff"}) == "segments"
                     ? BeamModel::kSegments
                     : BeamModel::kKirchhoff;
    beam.segments = table.IntegerOr("segments", 8, 1, kMostSegments);
    beam.order = table.IntegerOr("order", 3, 1, kHighestOrder);
    beam.axial_elastic = table.ChoiceOr("axial", "rigid", {"rigid", "elastic"}) == "elastic";
    beam.damping = table.NumberOr("damping", 0.0, kNonNegative);
    const std::string form = table.ChoiceOr("form", "chord", {"chord", "gradient", "printed"});
    beam.gradient_form = form != "printed";
    beam.along_chord = form == "chord";
    ReadTaper(table, &beam);
    ReadBendingStiffness(table, &beam);
    ReadAxialStiffness(table, &beam);
    beam.pose = TripleOrNone(table, "pose");
    beam.velocity = TripleOrNone(table, "velocity");
    beam.where = table.Where();
    const int index = static_cast<int>(scene_.beams.size());
    beams_[name] = index;
    ends_[name + ".start"] = {SceneEnd::Kind::kBeamStart, index, {0, 0}};
    ends_[name + ".end"] = {SceneEnd::Kind::kBeamEnd, index, {0, 0}};
    scene_.beams.push_back(beam);
  }
}

void SceneReader::ReadTaper(const TomlTable& table, SceneBeam* beam) {
  // At a twentieth of the size the section bends 160,000 times as easily: that is a hinge, not a
  // beam.
  constexpr double kLeastTaper = 0.05, kMostTaper = 1.0 / kLeastTaper;  // [-]
  if (!table.Has("taper")) {
    RefuseKeys(table, {"taper_of"}, "without `taper` nothing tapers");
  }
  beam->section.taper = table.NumberOr("taper", 1.0, kPositive);
  if (beam->section.taper < kLeastTaper || beam->section.taper > kMostTaper) {
    table.Fail("taper", "the section's size at the end is not of the order of that at the start",
               "use 0.05 to 20, of the size at the end over that at the start");
  }
  const std::string of = table.ChoiceOr("taper_of", "both", {"width", "height", "both"});
  beam->section.of = of == "width"    ? BeamSection::Of::kWidth
                     : of == "height" ? BeamSection::Of::kHeight
                                      : BeamSection::Of::kBoth;
}

void SceneReader::ReadBendingStiffness(const TomlTable& table, SceneBeam* beam) {
  if (table.Has("EI")) {
    if (table.Has("I")) table.Fail("I", "EI and I are both given", "remove one of them");
    if (table.Has("EA") || !(table.Has("area") || table.Has("density"))) {
      RefuseKeys(table, {"E"}, "EI is given, and nothing else is to be made of E");
    }
    beam->EI = table.Number("EI", kPositive);
  } else if (table.Has("E")) {
    beam->EI = table.Number("E", kPositive) * table.Number("I", kPositive);
  } else {
    table.Fail("EI", "the beam has no bending stiffness", "give EI, or E and I");
  }
}

// With axial = "rigid" it does nothing in this run; `unfurl effects` tries what it would do.
void SceneReader::ReadAxialStiffness(const TomlTable& table, SceneBeam* beam) {
  const double E = table.Has("E") ? table.Number("E", kPositive) : 0.0;
  if (table.Has("EA")) {
    RefuseKeys(table, {"area", "density"}, "EA is given, which this would make");
    beam->EA = table.Number("EA", kPositive);
  } else if (E > 0.0 && table.Has("area")) {
    RefuseKeys(table, {"density"}, "area is given, which this would make");
    beam->EA = E * table.Number("area", kPositive);
  } else if (E > 0.0 && table.Has("density")) {
    const double volume = beam->length * beam->section.Volume(1.0);  // of unit area at the start
    beam->EA = E * beam->mass / (table.Number("density", kPositive) * volume);
  } else if (beam->axial_elastic) {
    table.Fail("EA", "axial = \"elastic\" needs an axial stiffness",
               "give EA, or E with area or density");
  } else {
    RefuseKeys(table, {"area", "density"}, "without E nothing is made of it");
  }
}

void SceneReader::ReadWelds() {
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

}  // namespace unfurl::data
