#include "sim/record/certificate.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/text.h"
#include "sim/dynamics/observables.h"
#include "sim/kirchhoff/kirchhoff_shapes.h"
#include "sim/methods/choose_method.h"
#include "sim/methods/edges.h"
#include "sim/methods/load_peaks.h"
#include "sim/methods/make_stepper.h"
#include "sim/record/record.h"

namespace unfurl::sim {
namespace {

// Of the longest step that a run may take, its companion's, where that and not the tolerance limits
// the run: its error is then a 16th and less.
constexpr double kShorter = 0.5;
// Errors fall with this power of the number of segments (tests/verification), and of a smooth
// beam's shapes (docs/decisions/010-second-beam.md).
constexpr double kSegmentsPower = 2.0, kShapesPower = 3.0;
// With fewer segments to a beam the error does not fall with that power yet.
constexpr int kFewestSegments = 4;
// Shapes that a smooth beam's companion has more: as many again would cost fourfold.
constexpr int kMoreShapes = 2;

// Tolerances that a motion may be off (docs/accuracy.md).
constexpr double kPromised = 10.0;

// error of `own` = factor |own - other| where errors go with size^-power.
double RichardsonFactor(double own, double other, double power) {
  return 1.0 / std::fabs(1.0 - std::pow(own / other, power));
}

// The longest step, or the usual one between edges where these are closer [s].
double UsualLongestStep(const SimulateOptions& options, const Model& model) {
  const double duration = DurationOf(options, model);
  const auto parts = static_cast<double>(Edges(model, duration).count() + 1);
  return std::min(LongestStep(options, model), duration / parts);
}

// Half the segments are told from a finer mesh where they still are enough, and where no beam's
// companion is finer: differences of two signs would cancel.
bool HalvesSegments(const data::Scene& scene) {
  return std::none_of(scene.beams.begin(), scene.beams.end(), [](const data::SceneBeam& beam) {
    return beam.model == data::BeamModel::kKirchhoff || (beam.segments + 1) / 2 < kFewestSegments;
  });
}

double RootMeanSquare(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double value : values) sum += value * value;
  return values.empty() ? 0.0 : std::sqrt(sum / static_cast<double>(values.size()));
}

bool IsDefault(const std::string& name, const data::Scene& scene) {
  const auto is = [&](const std::string& owner, const char* part) { return name == owner + part; };
  for (const data::SceneMark& mark : scene.marks) {
    if (is(mark.name, ".x") || is(mark.name, ".y")) return true;
  }
  return std::any_of(scene.joints.begin(), scene.joints.end(), [&](const data::SceneJoint& joint) {
    return is(joint.name, ".theta") || is(joint.name, ".travel");
  });
}

}  // namespace

data::Scene CompanionMesh(const data::Scene& scene, bool finer, double* factor,
                          std::string* words) {
  data::Scene out = scene;
  std::vector<std::string> changes;
  *factor = 0.0;
  const bool twice = finer || !HalvesSegments(scene);
  const auto change = [&](const char* what, int from, int to, double power) {
    *factor = std::max(*factor, RichardsonFactor(from, to, power));
    const std::string text = fmt::format("{} {} in place of {}", what, to, from);
    if (std::find(changes.begin(), changes.end(), text) == changes.end()) changes.push_back(text);
  };
  for (data::SceneBeam& beam : out.beams) {
    if (beam.model == data::BeamModel::kKirchhoff) {
      const int more = std::min(beam.order + kMoreShapes, KirchhoffShapes::kMostModes);
      const int to = more > beam.order ? more : beam.order - kMoreShapes;
      change("order", beam.order, to, kShapesPower);
      beam.order = to;
    } else {
      const int to = twice ? 2 * beam.segments : (beam.segments + 1) / 2;
      change("segments", beam.segments, to, kSegmentsPower);
      beam.segments = to;
    }
  }
  *words = JoinWords(changes);
  return out;
}

bool Certificate::Run(const data::Scene& scene, const SimulateOptions& options, double factor,
                      const CertifyOptions& certify, const char* label) {
  RecordOptions record;
  record.simulate = options;
  record.shape_rate = 0.0;
  record.progress = certify.progress;
  for (const data::Quantity& q : certified_) record.quantities.push_back(q.name);
  Recording run = Record(CompileModel(scene), record);
  if (run.status == "interrupted") throw Interrupted();
  if (!run.Usable()) {
    problem_ = fmt::format("the companion {} is not usable: {}", label, run.message);
    return false;
  }
  Companion companion;
  companion.factor = factor;
  for (const data::Quantity& q : certified_) {
    companion.columns.push_back(run.run.Column(q.name));
  }
  for (const Load& load : loads_) companion.loads.push_back(load.Of(run.report));
  companions_.push_back(std::move(companion));
  return true;
}

std::shared_ptr<Certificate> Certificate::Make(const data::Scene& scene,
                                               const SimulateOptions& options,
                                               const CertifyOptions& certify) {
  auto out = std::make_shared<Certificate>();
  const std::shared_ptr<const Model> model = CompileModel(scene);
  const Observables all(*model, certify.quantities);
  for (const data::Quantity& q : all.quantities()) {
    if (!certify.quantities.empty() || IsDefault(q.name, scene)) out->certified_.push_back(q);
  }
  if (out->certified_.empty()) {
    out->problem_ = "there is neither a mark nor a joint whose error could be stated";
    return out;
  }
  for (std::size_t j = 0; j < model->joints.size(); ++j) {
    const Model::Joint& joint = model->joints[j];
    out->loads_.push_back(
        {joint.name + ".peak_pin_force", "N", false, j, joint.name + ".pin_force"});
    if (joint.latch < 0) continue;
    const auto latch = static_cast<std::size_t>(joint.latch);
    out->loads_.push_back(
        {joint.name + ".peak_moment", "N m", true, latch, joint.name + ".contact_moment"});
  }
  out->names_ = certify.quantities;
  out->promised_ = kPromised * ToleranceOf(options);
  out->length_ = options.length > 0.0 ? options.length : model->length_scale;
  out->duration_ = DurationOf(options, *model);
  SimulateOptions tighter = options;
  tighter.rtol = TighterTolerance(options.rtol);
  // Of the difference, 1 - 0.1 is the run's own error; the method of `auto` may differ, which is as
  // well.
  tighter.max_step = kShorter * UsualLongestStep(options, *model);
  if (!out->Run(scene, tighter, 1.0 / (1.0 - kTighter), certify, "of a tighter tolerance") ||
      !certify.mesh) {
    return out;
  }
  // A coarser mesh is cheap, but may be too coarse for the scene.
  for (const bool finer : {false, true}) {
    if (finer && !HalvesSegments(scene)) break;  // it was
    double factor = 0.0;
    const data::Scene other = CompanionMesh(scene, finer, &factor, &out->mesh_);
    if (out->mesh_.empty() || out->Run(other, options, factor, certify, "of another mesh")) {
      out->problem_.clear();
      break;
    }
  }
  return out;
}

void Certificate::Bind(std::vector<data::Quantity>* quantities) {
  column_.clear();
  const std::size_t before = quantities->size();
  for (const data::Quantity& q : certified_) {
    const auto at = std::find_if(quantities->begin(), quantities->begin() + before,
                                 [&](const data::Quantity& other) { return other.name == q.name; });
    column_.push_back(
        at == quantities->begin() + before ? -1 : static_cast<int>(at - quantities->begin()));
  }
  constexpr const char* kNames[] = {"error_time.", "error_mesh."};
  constexpr const char* kTexts[] = {"largest error of time stepping so far, estimated",
                                    "largest error of the mesh so far, estimated"};
  for (std::size_t k = 0; k < companions_.size(); ++k) {
    for (std::size_t i = 0; i < certified_.size(); ++i) {
      if (column_[i] < 0) continue;
      quantities->push_back({kNames[k] + certified_[i].name, certified_[i].units, kTexts[k]});
    }
  }
  errors_.assign(quantities->size() - before, 0.0);
  least_.assign(certified_.size(), HUGE_VAL);
  most_.assign(certified_.size(), -HUGE_VAL);
  moments_.assign(certified_.size(), {});
  for (Moments& moments : moments_) moments.errors.assign(companions_.size(), 0.0);
  samples_ = 0;
}

const std::vector<double>& Certificate::Add(std::span<const double> row) {
  std::size_t at = 0;
  for (std::size_t k = 0; k < companions_.size(); ++k) {
    const Companion& companion = companions_[k];
    for (std::size_t i = 0; i < certified_.size(); ++i) {
      if (column_[i] < 0) continue;
      const std::vector<double>& other = companion.columns[i];
      const double value = row[static_cast<std::size_t>(column_[i])];
      if (samples_ < other.size()) {
        const double error = kCaution * companion.factor * std::fabs(value - other[samples_]);
        errors_[at] = std::max(errors_[at], error);
        moments_[i].errors[k] += error * error;
      }
      ++at;
    }
  }
  ++samples_;
  for (std::size_t i = 0; i < certified_.size(); ++i) {
    if (column_[i] < 0) continue;
    const double value = row[static_cast<std::size_t>(column_[i])];
    least_[i] = std::min(least_[i], value);
    most_[i] = std::max(most_[i], value);
    Moments& moments = moments_[i];
    const double from = value - moments.mean;
    moments.mean += from / static_cast<double>(samples_);
    moments.squares += from * (value - moments.mean);
    moments.largest = std::max(moments.largest, std::fabs(value));
  }
  return errors_;
}

std::vector<Certificate::Line> Certificate::Lines() const {
  std::vector<Line> lines;
  const std::size_t kept = companions_.empty() ? 0 : errors_.size() / companions_.size();
  for (std::size_t i = 0; i < certified_.size(); ++i) {
    if (i >= column_.size() || column_[i] < 0 || samples_ == 0 || kept == 0) continue;
    Line line{certified_[i].name, certified_[i].units, errors_[lines.size()], 0.0,
              most_[i] - least_[i]};
    if (companions_.size() > 1) line.mesh = errors_[kept + lines.size()];
    lines.push_back(line);
  }
  return lines;
}

std::vector<Certificate::Line> Certificate::LoadLines(const SimulateReport& run) const {
  std::vector<Line> lines;
  if (companions_.empty()) return lines;
  const auto apart = [&](const Load& load, std::size_t companion) {
    return std::fabs(load.Of(run) - companions_[companion].loads[&load - loads_.data()]);
  };
  const bool struck = std::any_of(loads_.begin(), loads_.end(), [&](const Load& load) {
    return load.contact && load.Of(run) > 0.0;
  });
  // Two meshes may agree on one load by chance.
  double usual[] = {0.0, 0.0};
  for (int contact = 0; struck && companions_.size() > 1 && contact < 2; ++contact) {
    std::vector<double> parts;
    for (const Load& load : loads_) {
      if (load.contact != (contact == 1) || !(load.Of(run) > 0.0)) continue;
      parts.push_back(std::min(apart(load, 1) / load.Of(run), 1.0));
    }
    usual[contact] = RootMeanSquare(parts);
  }
  for (const Load& load : loads_) {
    const double value = load.Of(run);
    // Both may have missed their peak's very top.
    const double time =
        std::max(kCaution * companions_[0].factor * apart(load, 0), kPeakFound * value);
    Line line{load.name, load.units, time, 0.0, value};
    if (companions_.size() > 1) {
      const double factor = struck ? std::max(companions_[1].factor, 1.0) : companions_[1].factor;
      line.mesh = kCaution * std::max(factor * apart(load, 1), usual[load.contact ? 1 : 0] * value);
    }
    lines.push_back(line);
  }
  return lines;
}

}  // namespace unfurl::sim
