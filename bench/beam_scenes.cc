#include "beam_scenes.h"

#include <fmt/format.h>

#include <cmath>
#include <utility>

namespace unfurl::bench {
namespace {

using data::BeamModel;
using data::Scene;
using data::SceneBeam;
using data::SceneEnd;
using data::SceneJoint;

SceneEnd Along(int beam, double at) {
  SceneEnd end;
  end.kind = at == 0.0   ? SceneEnd::Kind::kBeamStart
             : at == 1.0 ? SceneEnd::Kind::kBeamEnd
                         : SceneEnd::Kind::kAlongBeam;
  end.index = beam;
  end.at = at;
  return end;
}

SceneEnd OnBody(int body, double x) {
  SceneEnd end;
  end.kind = SceneEnd::Kind::kBody;
  end.index = body;
  end.point = {x, 0.0};
  return end;
}

SceneBeam Beam(const char* name, double length, double mass, double EI, const BeamChoice& choice) {
  SceneBeam beam;
  beam.name = name;
  beam.length = length;
  beam.mass = mass;
  beam.EI = EI;
  beam.model = choice.model;
  (choice.model == BeamModel::kSegments ? beam.segments : beam.order) = choice.size;
  return beam;
}

}  // namespace

std::string BeamChoice::Name() const {
  return fmt::format("{} {}", model == BeamModel::kSegments ? "segments" : "smooth", size);
}

Scene SliderCrank(const BeamChoice& choice) {
  Scene scene;
  scene.name = "slider-crank";
  scene.duration = 4.0 * M_PI / kSpeed;
  data::SceneBody crank;
  crank.name = "crank";
  crank.mass = 0.1;
  crank.inertia = 2e-4;
  scene.bodies.push_back(crank);
  scene.beams.push_back(Beam("rod", kRod, kRodMass, kRodEI, choice));
  SceneJoint pivot;
  pivot.name = "pivot";
  pivot.outer = OnBody(0, -0.5 * kCrank);
  pivot.drive.emplace();
  pivot.drive->by_rate = true;
  pivot.drive->function = data::TimeFunction(kSpeed);
  SceneJoint pin;
  pin.name = "pin";
  pin.inner = OnBody(0, 0.5 * kCrank);
  pin.outer = Along(0, 0.0);
  pin.theta_rate = -kSpeed * (1.0 + kCrank / kRod);
  data::SceneBody block;
  block.name = "block";
  block.mass = kBlock;
  block.inertia = 1.8e-6;
  scene.bodies.push_back(block);
  SceneJoint wrist;
  wrist.name = "wrist";
  wrist.inner = Along(0, 1.0);
  wrist.outer = OnBody(1, 0.0);
  wrist.theta_rate = kSpeed * kCrank / kRod;
  SceneJoint guide;
  guide.name = "guide";
  guide.kind = SceneJoint::Kind::kSlider;
  guide.outer = OnBody(1, 0.0);
  guide.travel = kCrank + kRod;
  scene.joints = {pivot, pin, wrist, guide};
  for (const auto& [name, at] : {std::pair{"start", 0.0}, {"middle", 0.5}, {"end", 1.0}}) {
    scene.marks.push_back({name, Along(0, at), ""});
  }
  return scene;
}

Scene TwoBeams(const BeamChoice& choice) {
  Scene scene;
  scene.name = "two beams";
  scene.duration = 1.0;
  for (const char* name : {"beam1", "beam2"}) {
    scene.beams.push_back(Beam(name, 0.8, 0.424, 18.69, choice));
  }
  SceneJoint root;
  root.name = "joint1";
  root.outer = Along(0, 0.0);
  root.theta = 0.5 * M_PI;
  root.spring.emplace();
  root.spring->stiffness = 0.218;
  root.spring->preload = 1.57;
  SceneJoint outer = root;
  outer.name = "joint2";
  outer.inner = Along(0, 1.0);
  outer.outer = Along(1, 0.0);
  outer.theta = M_PI;
  outer.sign = -1.0;
  scene.joints = {root, outer};
  scene.marks.push_back({"tip", Along(1, 1.0), ""});
  return scene;
}

}  // namespace unfurl::bench
