#include "correlate/modes/ambient.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/count.h"
#include "base/refuse_option.h"
#include "base/statistics.h"
#include "correlate/modes/ambient_judges.h"
#include "correlate/modes/ambient_poles.h"
#include "correlate/modes/subspace.h"
#include "correlate/modes/turn.h"

namespace unfurl::correlate {

namespace {

using Complex = std::complex<double>;

// A part of the band, at its own rate.
struct Part {
  JointSignals joint;
  double low = 0.0, high = 0.0;  // [Hz]
};

// The record at its own rate, at a quarter of that, and so on, each for what has at most twenty
// samples a period there: ten block rows then see half a period and more, and lags at which all
// correlation is gone, which would only add noise, are few.
std::vector<Part> PartsOf(JointSignals joint, double low, double high) {
  constexpr Eigen::Index kFactor = 4, kFewest = 1000;  // instants left: a hundred blocks of ten
  constexpr double kSamplesPerPeriod = 20.0;           // as said above [-]
  std::vector<Part> out;
  double top = 0.5 / joint.step;
  while (true) {
    const double lowest = 1.0 / (kSamplesPerPeriod * joint.step);
    const bool last = lowest <= low || joint.samples() < kFactor * kFewest;
    Part part;
    part.low = last ? low : lowest;
    part.high = std::min(high, top);
    top = lowest;
    JointSignals next;
    if (!last) next = Decimated(joint, kFactor);
    part.joint = std::move(joint);
    if (part.low < part.high) out.push_back(std::move(part));
    if (last || next.stretches.empty()) break;
    joint = std::move(next);
  }
  return out;
}

// Standard errors, and how far its frequency moves between the halves.
void FillErrors(const Eigen::VectorXcd& influence, double block, AmbientMode* m) {
  const Complex s = m->mode.pole;
  const double size = std::abs(s), a = -s.real(), w = s.imag();
  const Eigen::VectorXd by_a = -influence.real(), by_w = influence.imag();
  const Eigen::VectorXd frequency = (a * by_a + w * by_w) / (kTau * size);
  const Eigen::VectorXd damping = (w * w * by_a - a * w * by_w) / (size * size * size);
  m->mode.frequency_sigma = BlockSigma(frequency, block, MemoryOf(m->mode));
  m->mode.damping_sigma = BlockSigma(damping, block, MemoryOf(m->mode));
  const Eigen::Index half = frequency.size() / 2;
  m->shift = frequency.tail(half).mean() - frequency.head(half).mean();
  // Halves are independent, each with twice the variance of the whole.
  m->shift_sigma = 2.0 * m->mode.frequency_sigma;
}

void FillShape(const Subspace& subspace, const SubspacePole& at, const std::vector<double>& scales,
               double block, Mode* mode) {
  const Eigen::Map<const Eigen::VectorXd> scale(scales.data(),
                                                static_cast<Eigen::Index>(scales.size()));
  const Eigen::MatrixXcd change = subspace.ShapeInfluence(at);
  const Eigen::VectorXcd shape = scale.asDiagonal() * at.shape;
  Eigen::Index largest = 0;
  shape.cwiseAbs().maxCoeff(&largest);
  const Complex top = shape(largest);
  mode->shape = shape / top;
  mode->shape_sigma.resize(2, shape.size());
  const Eigen::RowVectorXcd of_top = scale(largest) * change.row(largest) / top;
  for (Eigen::Index j = 0; j < shape.size(); ++j) {
    const Eigen::RowVectorXcd own = scale(j) * change.row(j) / top - mode->shape(j) * of_top;
    mode->shape_sigma(0, j) = BlockSigma(own.real().transpose(), block, MemoryOf(*mode));
    mode->shape_sigma(1, j) = BlockSigma(own.imag().transpose(), block, MemoryOf(*mode));
  }
}

// What the mode has of the references' variance, by its part of R_0.
void FillShare(const SubspacePole& at, const LagCovariances& covariances,
               const std::vector<double>& scales, Mode* mode) {
  double own = 0.0, all = 0.0, shape = 0.0;
  const Eigen::Index l = at.shape.size();
  for (std::size_t j = 0; j < covariances.references.size(); ++j) {
    const Eigen::Index row = covariances.references[j], column = static_cast<Eigen::Index>(j);
    own += 2.0 * (at.shape(row) * at.control(column)).real();
    all += covariances.At(0, l)(row, column);
    shape += std::norm(at.shape(row));
  }
  mode->share = all > 0.0 ? std::max(0.0, own / all) : 0.0;
  mode->amplitude.resize(l);
  const double rms = shape > 0.0 ? std::sqrt(std::max(own, 0.0) / shape) : 0.0;
  for (Eigen::Index j = 0; j < l; ++j) {
    mode->amplitude(j) = rms * at.shape(j) * scales[static_cast<std::size_t>(j)];
  }
}

// Of a mode each stretch of the record has its part, of a pole of noise as often the opposite.
// Signed roots, so that a strength that varies from stretch to stretch is no doubt of the mode.
double Evidence(const Eigen::MatrixXcd& blocks, const SubspacePole& at, double block,
                double memory) {
  const Eigen::VectorXd energy =
      Grouped((at.control.adjoint() * blocks).real().transpose(), block, memory);
  const Eigen::VectorXd root = energy.array().sign() * energy.array().abs().sqrt();
  const double mean = root.mean(), n = static_cast<double>(root.size());
  const double squares = (root.array() - mean).square().sum();
  return mean > 0.0 && squares > 0.0 ? mean * mean * n * (n - 1.0) / squares : 0.0;
}

AmbientMode ModeOf(const PoleCluster& cluster, const Subspace& subspace,
                   const LagCovariances& covariances, const std::vector<double>& scales) {
  AmbientMode out;
  Mode& mode = out.mode;
  // The mean over the orders, each by how well it tells the pole: what noise poles disturb at one
  // order they do not at another.
  double weights = 0.0, most = 0.0;
  // Where no pole of noise stands beside it, of the upper orders: lower ones have the shapes of
  // modes that they lack mixed in.
  const SubspacePole* best = nullptr;
  Eigen::VectorXcd influence = Eigen::VectorXcd::Zero(covariances.blocks.cols());
  for (const StableMode* c : cluster) {
    const Eigen::VectorXcd own = subspace.Influence(c->pole);
    const double weight = 1.0 / std::max(own.squaredNorm(), std::numeric_limits<double>::min());
    mode.pole += weight * c->pole.pole;
    influence += weight * own;
    weights += weight;
    if (weight > most && 2 * c->pole.order > cluster.back()->pole.order) {
      most = weight;
      best = &c->pole;
    }
  }
  mode.pole /= weights;
  influence /= weights;
  mode.frequency = std::abs(mode.pole) / kTau;
  mode.damping = -mode.pole.real() / std::abs(mode.pole);
  mode.members = static_cast<int>(cluster.size());
  const double block = covariances.block_seconds;
  FillErrors(influence, block, &out);
  FillShape(subspace, *best, scales, block, &mode);
  FillShare(*best, covariances, scales, &mode);
  mode.evidence = Evidence(subspace.ControlOfBlocks(*best), *best, block, MemoryOf(mode));
  return out;
}

// What a pole of noise alone would rarely show: of as many complex numbers as there are references
// the one combination is looked at that shows most, and some tens of clusters are. And each follows
// the noise that it is judged by, which makes half as much again of it.
double AmbientEvidenceAsked(std::size_t references, double chance) {
  constexpr double kClusters = 30.0, kFollowed = 2.0;  // as said above, the latter rounded up [-]
  return kFollowed *
         ChiSquareQuantile(1.0 - chance / kClusters, 2.0 * static_cast<double>(references));
}

// Poles of the highest order that swing all through the record, whether they became modes or not.
void CountLeftOut(const Subspace& subspace, Eigen::Index order, const Part& part,
                  const LagCovariances& covariances, double asked, AmbientFit* fit) {
  for (const SubspacePole& pole : subspace.Poles(order)) {
    AmbientSwing swing;
    swing.frequency = std::abs(pole.pole) / kTau;
    swing.damping = -pole.pole.real() / std::abs(pole.pole);
    if (!(swing.frequency >= part.low && swing.frequency < part.high && swing.damping > 0.0)) {
      continue;
    }
    Mode mode;
    mode.pole = pole.pole;
    mode.damping = swing.damping;
    const double evidence =
        Evidence(subspace.ControlOfBlocks(pole), pole, covariances.block_seconds, MemoryOf(mode));
    FillShare(pole, covariances, part.joint.scale, &mode);
    swing.share = mode.share;
    if (evidence > asked && swing.share > 0.0) fit->left_out.push_back(swing);
  }
}

// Modes and poles of a part of the band.
void Search(const Part& part, const AmbientOptions& options, AmbientFit* fit) {
  // Rows: half a period of what is slowest here, and lags up to twice that. References: more tell
  // little that these do not. Blocks: enough that even the slowest mode's can be taken together.
  constexpr Eigen::Index kLeastRows = 10, kReferences = 12, kBlocks = 200;
  const Eigen::Index l = part.joint.stretches.front().value.rows();
  // As many block rows as the highest order asks for.
  const Eigen::Index rows = std::max(kLeastRows, options.max_order / l + 2);
  const LagCovariances covariances = Covariances(part.joint, 2 * rows - 1, kReferences, kBlocks);
  // Of whose scatter a standard error can be made: known to a sixth [-].
  constexpr Eigen::Index kFewestBlocks = 20;
  if (covariances.blocks.cols() < kFewestBlocks) return;
  const Subspace subspace(covariances, l, rows, part.joint.step);
  const PoleDiagram diagram = DiagramOf(subspace, part.low, part.high, options);
  const double asked = AmbientEvidenceAsked(covariances.references.size(), options.chance);
  const double sure = NormalQuantile(1.0 - options.chance);
  for (const PoleCluster& cluster : Clusters(diagram, options)) {
    AmbientMode m = ModeOf(cluster, subspace, covariances, part.joint.scale);
    // Nothing that is driven by noise grows.
    if (m.mode.evidence < asked || m.mode.damping < -sure * m.mode.damping_sigma) continue;
    fit->modes.push_back(std::move(m));
  }
  CountLeftOut(subspace, 2 * static_cast<Eigen::Index>(diagram.size()), part, covariances, asked,
               fit);
  for (const auto& row : diagram) {
    for (const StableMode& c : row) fit->poles.push_back(c.seen);
  }
}

// One mode found in two parts, or twice, is one: that of most evidence.
void DropTwins(const AmbientOptions& options, std::vector<AmbientMode>* modes) {
  constexpr double kSame = 3.0;   // standard errors of the difference
  constexpr double kAlike = 0.8;  // MAC: closely spaced modes differ in shape
  std::stable_sort(modes->begin(), modes->end(), [](const AmbientMode& a, const AmbientMode& b) {
    return a.mode.evidence > b.mode.evidence;
  });
  std::vector<AmbientMode> kept;
  for (AmbientMode& m : *modes) {
    const bool known = std::any_of(kept.begin(), kept.end(), [&](const AmbientMode& other) {
      const double near =
          std::max(options.frequency_tolerance * m.mode.frequency,
                   kSame * std::hypot(m.mode.frequency_sigma, other.mode.frequency_sigma));
      return std::abs(m.mode.frequency - other.mode.frequency) < near &&
             ModalAssurance(m.mode.shape, other.mode.shape) > kAlike;
    });
    if (!known) kept.push_back(std::move(m));
  }
  std::sort(kept.begin(), kept.end(), [](const AmbientMode& a, const AmbientMode& b) {
    return a.mode.frequency < b.mode.frequency;
  });
  *modes = std::move(kept);
}

// Each dot of the diagram with the mode that it stands for.
void NamePoles(const AmbientOptions& options, AmbientFit* fit) {
  for (StabilisationPole& pole : fit->poles) {
    double nearest = 2.0 * options.frequency_tolerance;
    for (std::size_t k = 0; k < fit->modes.size() && pole.stable(); ++k) {
      const double f = fit->modes[k].mode.frequency;
      const double off = std::abs(f - pole.frequency) / f;
      if (off >= nearest) continue;
      nearest = off;
      pole.mode = static_cast<int>(k);
    }
  }
}

void Check(const AmbientOptions& o) {
  const RefuseOption refuse("AmbientOptions");
  if (!(o.low >= 0.0) || !(o.high > o.low)) refuse("low", "there is no band between low and high");
  if (o.max_order < 4) refuse("max_order", "fewer than two modes", "give 4 or more");
  if (!(o.max_damping > 0.0 && o.max_damping <= 1.0)) refuse("max_damping", "is no damping ratio");
  if (!(o.persistence >= 0.0 && o.persistence <= 1.0)) refuse("persistence", "is no part of 1");
  if (!(o.chance > 0.0 && o.chance < 1.0)) refuse("chance", "is no probability");
  for (const double tolerance : {o.frequency_tolerance, o.damping_tolerance, o.shape_tolerance}) {
    if (!(tolerance > 0.0)) refuse("frequency_tolerance", "a tolerance is not positive");
  }
}

}  // namespace

AmbientFit IdentifyAmbientModes(std::span<const DecaySignal> signals,
                                const AmbientOptions& options) {
  Check(options);
  AmbientFit out;
  // A second of silence teaches nothing: fewer samples than five times the lags of ten block rows.
  constexpr Eigen::Index kFewest = 400;
  constexpr double kPeriods = 10.0;  // in the record: slower swings are a trend's
  const JointSignals joint = OnJointGrid(signals);
  out.step = joint.step;
  out.duration = joint.Duration();
  if (joint.samples() < kFewest) {
    out.message = fmt::format("{} instants at which every signal is known; {} are the fewest",
                              joint.samples(), kFewest);
    return out;
  }
  for (std::size_t j = 0; j < signals.size(); ++j) {
    if (joint.scale[j] > 0.0) continue;
    out.message = fmt::format("{} never changes", signals[j].name);
    return out;
  }
  out.low = options.low > 0.0 ? options.low : kPeriods / out.duration;
  out.high = std::min(options.high, 0.5 / joint.step);
  for (const Part& part : PartsOf(joint, out.low, out.high)) Search(part, options, &out);
  DropTwins(options, &out.modes);
  NamePoles(options, &out);
  JudgeLeftOut(&out);
  JudgeRecord(joint, options, &out);
  JudgeModes(joint, options, &out);
  if (out.modes.empty()) {
    out.status = DecayStatus::kNothingFound;
    out.message = "no pole stays where it is from order to order and all through the record";
    return out;
  }
  out.status = DecayStatus::kGood;
  const auto doubtful = std::count_if(out.modes.begin(), out.modes.end(),
                                      [](const AmbientMode& m) { return !m.doubts.empty(); });
  out.message =
      fmt::format("{} of a structure driven by noise{}", Counted(out.modes.size(), "mode"),
                  doubtful > 0 ? fmt::format(", {} of them in doubt", doubtful) : "");
  return out;
}

}  // namespace unfurl::correlate
