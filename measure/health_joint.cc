// A move, step or drift of each camera in turn, by generalized least squares over the readings of
// all: the marks' places are eliminated flash by flash, and the calibration's errors, which are the
// same at every flash, once for all. So what a calibration's error may do is no sign of a fault.
#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include "base/dense.h"
#include "base/statistics.h"
#include "measure/health_flash.h"
#include "measure/health_view.h"

namespace unfurl::measure {

namespace {

constexpr int kShapes = 3;                // functions of time: 1, a step, t from the middle
constexpr std::size_t kMostJoint = 1500;  // flashes: more gain nothing on the calibration's errors
constexpr std::size_t kMoments = 64;      // of a step, that are independent of each other

using Shape = Eigen::Matrix<double, kShapes, 1>;

class Joint {
 public:
  Joint(const HealthEvidence& evidence, const Triangulator& triangulator,
        const Hypothesis& likeliest, std::size_t marks)
      : evidence_(evidence),
        cameras_(triangulator.cameras()),
        likeliest_(likeliest),
        errors_(triangulator) {
    const Eigen::Index r = errors_.columns();
    GG_ = Eigen::MatrixXd::Identity(r, r);
    Gy_ = Eigen::VectorXd::Zero(r);
    hG_.assign(cameras_, Eigen::MatrixXd::Zero(kShapes, r));
    hh_.assign(cameras_, Eigen::Matrix<double, kShapes, kShapes>::Zero());
    hy_.assign(cameras_, Shape::Zero());
    if (evidence.size() > 0) {
      middle_ = 0.5 * (evidence.t(0) + evidence.t(evidence.size() - 1));
      half_ = std::max(0.5 * (evidence.t(evidence.size() - 1) - evidence.t(0)), 1e-9);
    }
    std::size_t lit = 0;
    for (std::size_t i = 0; i < evidence.size(); ++i) lit += evidence.mark(i) >= 0;
    // An odd stride meets all marks of a turn of any length but its own multiples.
    const std::size_t stride = std::max<std::size_t>(1, lit / kMostJoint) | 1U;
    std::vector<Eigen::Vector3d> last(marks, triangulator.centre());
    std::size_t k = 0;
    for (std::size_t i = 0; i < evidence.size(); ++i) {
      if (evidence.mark(i) < 0 || k++ % stride != 0) continue;
      if (auto flash = TermsOf(i, &last[static_cast<std::size_t>(evidence.mark(i))])) Add(*flash);
    }
    solver_.compute(GG_);
  }

  std::size_t flashes() const { return terms_.size(); }
  double middle() const { return middle_; }
  double half() const { return half_; }

  // A camera's coefficients of some of the functions: value, covariance, and how much the loss is
  // less than with none.
  struct Answer {
    Eigen::VectorXd value;       // [px]
    Eigen::MatrixXd covariance;  // [px^2]
    double gain = 0.0;           // [-]
  };
  Answer Solve(std::size_t camera, const std::vector<int>& shapes) const {
    const auto n = static_cast<Eigen::Index>(shapes.size());
    Eigen::MatrixXd V(n, n), X(n, GG_.cols());
    Eigen::VectorXd y(n);
    for (Eigen::Index a = 0; a < n; ++a) {
      const int k = shapes[static_cast<std::size_t>(a)];
      X.row(a) = hG_[camera].row(k);
      y(a) = hy_[camera](k);
      for (Eigen::Index b = 0; b < n; ++b) {
        V(a, b) = hh_[camera](k, shapes[static_cast<std::size_t>(b)]);
      }
    }
    const Eigen::MatrixXd solved = solver_.solve(X.transpose());
    V -= X * solved;
    y -= solved.transpose() * Gy_;
    Answer out;
    const Eigen::LDLT<Eigen::MatrixXd> own(V);
    out.value = own.solve(y);
    out.covariance = own.solve(Eigen::MatrixXd::Identity(n, n));
    out.gain = y.dot(out.value);
    if (!out.value.allFinite() || !out.covariance.allFinite()) {
      out = {Eigen::VectorXd::Zero(n), Eigen::MatrixXd::Identity(n, n) * HUGE_VAL, 0.0};
    }
    return out;
  }

  // Of what is left without these functions of a camera.
  double Overdispersed(std::size_t camera, const std::vector<int>& shapes) const {
    const Answer answer = Solve(camera, shapes);
    Eigen::VectorXd left = Gy_;
    for (std::size_t k = 0; k < shapes.size(); ++k) {
      left -= hG_[camera].row(shapes[k]).transpose() * answer.value(static_cast<Eigen::Index>(k));
    }
    const Eigen::VectorXd z = solver_.solve(left);
    return Overdispersion(evidence_, terms_, [&](const FlashTerms& flash) {
      const Shape s = ShapeAt(evidence_.t(flash.line));
      Eigen::VectorXd r = flash.r - flash.G * z;
      for (std::size_t k = 0; k < shapes.size(); ++k) {
        r(static_cast<Eigen::Index>(camera)) -=
            s(shapes[k]) * answer.value(static_cast<Eigen::Index>(k));
      }
      return r;
    });
  }

 private:
  // What the likeliest fault adds to a camera's reading.
  double Taken(std::size_t camera, double t) const {
    const Fault& fault = likeliest_.fault;
    if (static_cast<int>(camera) != fault.camera) return 0.0;
    if (fault.kind == FaultKind::kDrifting) return fault.offset_px + fault.slope * (t - fault.at);
    return t >= fault.from ? fault.offset_px : likeliest_.before_px;
  }

  Shape ShapeAt(double t) const {
    return {1.0, t >= likeliest_.fault.from ? 1.0 : 0.0, (t - middle_) / half_};
  }

  std::optional<FlashTerms> TermsOf(std::size_t i, Eigen::Vector3d* last) const {
    std::array<double, CameraBank::kMaxCameras> taken{};
    for (std::size_t c = 0; c < cameras_; ++c) taken[c] = Taken(c, evidence_.t(i));
    Eigen::Vector3d at = *last;
    auto out = errors_.TermsOf(evidence_, i, taken, &at);
    // A reading that is wrong by itself tells nothing of its camera's fault.
    constexpr double kWild = 1e-5;  // chance that good readings are taken for wrong ones [-]
    if (!out || out->chi_square > ChiSquareQuantile(1.0 - kWild, out->readings - 3)) return {};
    *last = at;
    for (std::size_t c = 0; c < cameras_; ++c) out->r(static_cast<Eigen::Index>(c)) += taken[c];
    return out;
  }

  void Add(const FlashTerms& flash) {
    const Shape s = ShapeAt(evidence_.t(flash.line));
    const Eigen::VectorXd y = flash.P * flash.r;
    const Eigen::MatrixXd PG = flash.P * flash.G;
    GG_.noalias() += flash.G.transpose() * PG;
    Gy_.noalias() += flash.G.transpose() * y;
    for (std::size_t c = 0; c < cameras_; ++c) {
      const auto k = static_cast<Eigen::Index>(c);
      hG_[c].noalias() += s * PG.row(k);
      hh_[c].noalias() += flash.P(k, k) * s * s.transpose();
      hy_[c] += y(k) * s;
    }
    terms_.push_back(flash);
  }

  const HealthEvidence& evidence_;
  std::size_t cameras_;
  const Hypothesis& likeliest_;
  FlashErrors errors_;
  double middle_ = 0.0, half_ = 1.0;  // of the record [s]
  Eigen::MatrixXd GG_;                // r x r, with the prior [-]
  Eigen::VectorXd Gy_;
  std::vector<Eigen::MatrixXd> hG_;  // by camera, shapes x r
  std::vector<Eigen::Matrix<double, kShapes, kShapes>> hh_;
  std::vector<Shape> hy_;
  std::vector<FlashTerms> terms_;
  Eigen::LLT<Eigen::MatrixXd> solver_;  // of GG_
};

// What may have happened to a camera, and which of its numbers says that it did.
struct Story {
  std::vector<int> shapes;
  Eigen::Index told;
};
const std::vector<Story>& Stories() {
  static const std::vector<Story> kStories = {{{0}, 0}, {{1}, 0}, {{0, 1}, 1}, {{0, 2}, 1}};
  return kStories;
}

struct Verdict {
  std::size_t camera = 0, story = 0;
  Joint::Answer answer;
  double gain = -HUGE_VAL;  // less the price of its numbers [-]
};

Verdict BestStory(const Joint& joint, std::size_t camera, bool stepped) {
  Verdict best;
  for (std::size_t k = 0; k < Stories().size(); ++k) {
    const Story& story = Stories()[k];
    const bool step = story.shapes.back() == 1;
    if (step && !stepped) continue;
    const Joint::Answer answer = joint.Solve(camera, story.shapes);
    const double numbers = static_cast<double>(story.shapes.size()) + (step ? 1.0 : 0.0);
    const double gain = answer.gain - numbers * std::log(static_cast<double>(joint.flashes()));
    if (gain > best.gain) best = {camera, k, answer, gain};
  }
  return best;
}

void Tell(const Verdict& best, const Joint& joint, double wide, const Hypothesis& likeliest,
          Fault* fault) {
  const Story& story = Stories()[best.story];
  const auto sigma = [&](Eigen::Index k) { return std::sqrt(wide * best.answer.covariance(k, k)); };
  *fault = {};
  fault->camera = static_cast<int>(best.camera);
  if (story.shapes.back() == 2) {
    fault->kind = FaultKind::kDrifting;
    fault->offset_px = best.answer.value(0);
    fault->sigma_px = sigma(0);
    fault->slope = best.answer.value(1) / joint.half();
    fault->slope_sigma = sigma(1) / joint.half();
    fault->at = joint.middle();
    return;
  }
  fault->offset_px = best.answer.value(story.told);
  fault->sigma_px = sigma(story.told);
  if (story.shapes.back() != 1) return;
  fault->from = likeliest.fault.from;
  fault->earliest = likeliest.fault.earliest;
  fault->latest = likeliest.fault.latest;
}

}  // namespace

double SigmasOfAnOffset(const HealthOptions& options, std::size_t cameras) {
  // Two-sided, shared by every camera, shape, and moment of a step.
  const double tests = static_cast<double>(cameras * (kMoments + 2));
  return NormalQuantile(1.0 - 0.5 * options.false_alarm / tests);
}

bool JudgeOffsets(const HealthEvidence& evidence, const Triangulator& triangulator,
                  const Hypothesis& likeliest, const HealthOptions& options, std::size_t marks,
                  Fault* fault) {
  const Joint joint(evidence, triangulator, likeliest, marks);
  constexpr std::size_t kFewest = 8;  // flashes
  if (joint.flashes() < kFewest) return false;
  const std::size_t cameras = triangulator.cameras();
  const bool stepped = std::isfinite(likeliest.fault.from);
  std::vector<Verdict> all;
  for (std::size_t c = 0; c < cameras; ++c) all.push_back(BestStory(joint, c, stepped));
  const auto best = std::max_element(
      all.begin(), all.end(), [](const Verdict& a, const Verdict& b) { return a.gain < b.gain; });
  const double wide = joint.Overdispersed(best->camera, Stories()[best->story].shapes);
  const Eigen::Index told = Stories()[best->story].told;
  const double limit = SigmasOfAnOffset(options, cameras);
  if (!(std::abs(best->answer.value(told)) >
        limit * std::sqrt(wide * best->answer.covariance(told, told)))) {
    return false;
  }
  Tell(*best, joint, wide, likeliest, fault);
  const double enough = 2.0 * std::log(static_cast<double>(cameras - 1) / options.doubt);
  for (const Verdict& other : all) {
    if (other.camera != best->camera && (best->gain - other.gain) / wide < enough) {
      fault->suspects.push_back(static_cast<int>(other.camera));
    }
  }
  return true;
}

}  // namespace unfurl::measure
