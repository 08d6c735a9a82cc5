#pragma once

#include <array>
#include <string>
#include <vector>

#include "data/scene.h"
#include "sim/constraints/assembly.h"
#include "sim/model/composites.h"
#include "sim/model/model.h"

namespace unfurl::sim {

// From a scene to a model: merge welded bodies, number them, place everything, fill the
// effects, and check that the constraints are independent. Private to the room; see Compile in
// sim/model.h.
class Compiler {
 public:
  explicit Compiler(const data::Scene& scene);
  Model Run();

 private:
  struct BeamEnd {
    const data::SceneWeld* weld = nullptr;  // to a body
    int station = -1;                       // body
  };

  struct Attached {      // to a smooth beam
    double at = 0.0;     // place, of the length [-]
    int composite = -1;  // what rides there and is part of the beam; -1: none
    int body = -1;
  };
  struct Smooth {
    std::vector<Attached> attached;
    KirchhoffShapes::Ends ends;
    int index = -1;  // into Model::kirchhoff
  };
  // `loaded`: something may act there.
  Attached& AttachmentAt(const data::SceneEnd& end, bool loaded = true);

  // compile.cc
  void FindBeamWelds();
  void NumberRigidBodies();
  void FillOutputs();
  void FillSensors();
  double ReachOfBodies() const;  // [m]
  void FillState();
  void CheckConstraints();
  // compile_checks.cc
  void WarnOfLooseParts();
  void CheckStops();
  // Keys that do nothing without a table that is not there.
  void WarnOfIdleKeys();
  std::string WhereLengthsAreKept() const;
  void RefuseDrivesThatFight(std::size_t redundant, const std::string& which) const;
  // compile_kirchhoff.cc
  bool IsSmooth(int beam) const;
  // Of a body of a beam (a segment, or all of a smooth one), from the start [m].
  double CentreOfBody(int beam, int k) const;
  bool OnSmooth(const data::SceneEnd& end) const;
  void FindAttachments();
  void BendAt(const data::SceneEnd& end);
  void AttachWelds();
  void AttachJoints();
  void AttachLoads();
  void AttachMarks();
  void CheckSmoothBeams() const;
  int NumberSmoothBodies(int next);
  void FillSmooth();
  void AddWeldRows(JointRows* rows);
  MovingPoint SmoothPoint(const data::SceneEnd& end);
  // compile_places.cc
  void MakeLinks();
  void PlaceAll();
  std::vector<int> Roots(const std::vector<std::string>& placed_by) const;
  // What a drive prescribes for its joint's coordinate.
  data::TimeFunction TargetOf(const data::SceneJoint& joint) const;
  // compile_beams.cc
  void FillBending();
  void AddStation(const BeamEnd& end, int beam);
  void FillFields();
  // compile_loads.cc
  void FillLinearSprings();
  void FillForces();
  LoadPoint LoadPointOf(const data::SceneEnd& end, double* angle);
  // compile_joints.cc
  void FillJoints();
  void AddRows(std::size_t joint, const Model::Joint& out, JointRows* rows);
  void AddEffects(std::size_t joint, Model::Joint* out);

  int NodeOfBeam(int beam) const { return static_cast<int>(merged_.list.size()) + beam; }
  int NodeOf(const data::SceneEnd& end) const;
  // The end's point and axis in its node's frame.
  PlanePose InNode(const data::SceneEnd& end) const;
  BeamEnd& EndOf(const data::SceneEnd& end);
  // The body-side end that stands for a beam's end: of a welded end, the body it is welded to.
  data::SceneEnd Carrier(const data::SceneEnd& end);
  // The body and point of an end, and the angle of the end's axis in the body. Beam ends that are
  // not welded move with the outer half segment.
  MovingPoint PointOf(const data::SceneEnd& end, double* angle);
  double BodyAngle(const data::SceneEnd& end);  // at the start [rad]

  data::Scene scene_;
  Composites merged_;
  Model model_;
  std::vector<std::array<BeamEnd, 2>> beam_ends_;
  std::vector<Smooth> smooth_;  // by beam
  std::vector<const data::SceneWeld*> weld_rows_;
  std::vector<int> first_segment_;  // body by beam; of a smooth one its root
  std::vector<int> body_of_composite_;
  std::vector<Link> links_;
  Placement start_, hang_;
  std::vector<Constraints::Longitudinal> longitudinal_;  // by element
  std::vector<std::string> element_names_;
};

bool OnBeam(const data::SceneEnd& end);
// Place on a beam, of its length.
double PlaceOn(const data::SceneEnd& end);
// Of a weld between a body and a beam's end.
const data::SceneEnd& BodySide(const data::SceneWeld& weld);
const data::SceneEnd& BeamSide(const data::SceneWeld& weld);
// Of the beam's tangent there against the x axis of the body [rad].
double BeamAgainstBody(const data::SceneWeld& weld);

}  // namespace unfurl::sim
