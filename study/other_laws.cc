#include "study/other_laws.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "correlate/fit/workers.h"

namespace unfurl::study {

namespace {

using JointKind = data::SceneJoint::Kind;

constexpr double kPart = 0.01;  // of the largest kinetic energy, that a law takes
// Of the largest rate, at which friction creeps in place of sticking: a hundredth of a swing's
// losses, and no shorter steps than the swing's own.
constexpr double kCreep = 0.05;
constexpr int kInstants = 1000;  // over the record: a hundred to a swing, of ten

bool HasLoss(const data::SceneJoint& joint) {
  return joint.damper || joint.quadratic_damper || joint.friction;
}

// Rate of a joint, even in time, and what it integrates to.
struct Moves {
  double step = 0.0, fastest = 0.0;  // [s], [1/s]
  std::vector<double> rate;
  // Of |rate|^power.
  double Sum(double power) const {
    double sum = 0.0;
    for (const double w : rate) sum += std::pow(std::abs(w), power);
    return sum * step;
  }
};

std::string RateOf(const data::SceneJoint& joint) {
  return joint.name + (joint.kind == JointKind::kSlider ? ".travel_rate" : ".theta_rate");
}

void Add(const data::SceneJoint& joint, const Moves& moves, double energy,
         std::vector<OtherLaw>* out) {
  const bool slides = joint.kind == JointKind::kSlider;
  const std::string table = "joint." + joint.name + ".";
  const std::string force = slides ? "N" : "N m", rate = slides ? "m/s" : "rad/s";
  if (!joint.friction) {
    const double amount = energy / moves.Sum(1.0);
    out->push_back(
        {"dry friction in " + joint.name,
         force,
         amount,
         {fmt::format("{}friction.{}={:.17g}", table, slides ? "force" : "moment", amount),
          fmt::format("{}friction.creep_rate={:.17g}", table, kCreep * moves.fastest)}});
  }
  if (!joint.damper) {
    const double amount = energy / moves.Sum(2.0);
    out->push_back({"viscous damping in " + joint.name,
                    force + "/(" + rate + ")",
                    amount,
                    {fmt::format("{}damper.damping={:.17g}", table, amount)}});
  }
  if (!joint.quadratic_damper) {
    const double amount = energy / moves.Sum(3.0);
    out->push_back({"damping by the square of the rate in " + joint.name,
                    force + "/(" + rate + ")^2",
                    amount,
                    {fmt::format("{}quadratic_damper.damping={:.17g}", table, amount)}});
  }
}

}  // namespace

std::vector<OtherLaw> OtherLawsOf(const std::vector<data::SceneJoint>& joints,
                                  const SceneModel& model, std::span<const double> theta,
                                  double duration) {
  std::vector<const data::SceneJoint*> asked;
  for (const data::SceneJoint& joint : joints) {
    if (HasLoss(joint) && !joint.drive && joint.kind != JointKind::kPinInSlot)
      asked.push_back(&joint);
  }
  std::vector<OtherLaw> out;
  if (asked.empty() || !(duration > 0.0)) return out;
  const double step = duration / kInstants;
  correlate::Stamps stamps;
  std::vector<double> t;
  for (int i = 0; i <= kInstants; ++i) t.push_back(step * i);
  stamps.quantities.push_back({"energy", "energy.kinetic", t});
  for (const data::SceneJoint* joint : asked) {
    stamps.quantities.push_back({joint->name, RateOf(*joint), t});
  }
  const correlate::Prediction run = correlate::EvaluateChecked(model, theta, stamps);
  if (run.status != correlate::ModelStatus::kGood) return out;
  const double energy = kPart * run.quantities[0].values.maxCoeff();
  for (std::size_t i = 0; i < asked.size(); ++i) {
    const Eigen::VectorXd& rate = run.quantities[i + 1].values;
    const Moves moves{step, rate.cwiseAbs().maxCoeff(), {rate.begin(), rate.end()}};
    if (energy > 0.0 && moves.fastest > 0.0) Add(*asked[i], moves, energy, &out);
  }
  return out;
}

}  // namespace unfurl::study
