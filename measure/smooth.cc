#include "measure/smooth.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "base/dense.h"
#include "base/statistics.h"

namespace unfurl::measure {

namespace {

using Matrix9 = Eigen::Matrix<double, 9, 9>;
using Means = Eigen::Matrix<double, 9, Eigen::Dynamic>;  // state, then one column per shared draw

// One stretch of one mark without gaps.
struct Stretch {
  std::vector<std::size_t> samples;  // indices into the tracks
};

// What a stretch itself says of its motion, in which all that is believed of it is measured;
// nothing of it comes from beyond a gap.
struct Scale {
  double interval = 1.0;      // median, between its samples [s]
  double speed = 1.0;         // the highest between neighbours, errors at the least [m/s]
  double acceleration = 1.0;  // the highest change of that over an interval [m/s^2]

  // Standard deviations that velocity and acceleration start with, and after an event: as good as
  // nothing is known of them. Larger ones would cost digits and tell no more.
  double first_speed() const { return 10.0 * speed; }
  double first_acceleration() const { return 10.0 * acceleration; }
  // Spectral densities of the jerk that are looked at, with fourteen decades between [m^2/s^5]; the
  // largest moves a mark within an interval by ten times as much as it ever moved.
  double least_jerk() const { return 1e-14 * most_jerk(); }
  double most_jerk() const { return 20.0 * std::pow(first_speed(), 2) / std::pow(interval, 3); }
};

Scale ScaleOf(const data::Tracks& tracks, const Stretch& stretch) {
  constexpr double kLeastSigmas = 10.0;  // a mark that stands still moves by its errors
  std::vector<double> steps;
  double sigma = 0.0, speed = 0.0, acceleration = 0.0;
  Eigen::Vector3d v = Eigen::Vector3d::Zero();
  for (std::size_t k = 0; k < stretch.samples.size(); ++k) {
    const std::size_t i = stretch.samples[k];
    sigma = std::max(sigma, std::sqrt(tracks.Covariance(i).trace()));
    if (k == 0) continue;
    const std::size_t before = stretch.samples[k - 1];
    const double dt = tracks.t[i] - tracks.t[before];
    const Eigen::Vector3d chord = (tracks.p.col(static_cast<Eigen::Index>(i)) -
                                   tracks.p.col(static_cast<Eigen::Index>(before))) /
                                  dt;
    if (k > 1) acceleration = std::max(acceleration, (chord - v).norm() / dt);
    speed = std::max(speed, chord.norm());
    v = chord;
    steps.push_back(dt);
  }
  Scale scale;
  if (steps.empty()) return scale;
  scale.interval = Median(steps);
  const double least = kLeastSigmas * sigma / scale.interval;
  if (speed + least > 0.0) scale.speed = std::max(speed, least);
  scale.acceleration = std::max(acceleration, scale.speed / scale.interval * 0.1);
  return scale;
}

Matrix9 Transition(double dt) {
  Matrix9 F = Matrix9::Identity();
  F.block<3, 3>(0, 3).diagonal().setConstant(dt);
  F.block<3, 3>(3, 6).diagonal().setConstant(dt);
  F.block<3, 3>(0, 6).diagonal().setConstant(0.5 * dt * dt);
  return F;
}

void AddJerk(double dt, double jerk, Matrix9* P) {
  const double q[3][3] = {{std::pow(dt, 5) / 20.0, std::pow(dt, 4) / 8.0, std::pow(dt, 3) / 6.0},
                          {std::pow(dt, 4) / 8.0, std::pow(dt, 3) / 3.0, dt * dt / 2.0},
                          {std::pow(dt, 3) / 6.0, dt * dt / 2.0, dt}};
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      P->block<3, 3>(3 * i, 3 * j).diagonal().array() += jerk * q[i][j];
    }
  }
}

// Filter and smoother over one stretch, whose sections each have a process noise.
class StretchSmoother {
 public:
  StretchSmoother(const data::Tracks& tracks, const Stretch& stretch, const Scale& scale,
                  const SmoothOptions& options)
      : tracks_(tracks), stretch_(stretch), scale_(scale), options_(options) {
    section_.resize(stretch.samples.size());
    for (std::size_t i = 0; i < section_.size(); ++i) {
      const auto after = std::upper_bound(options.events.begin(), options.events.end(), Time(i));
      section_[i] = after - options.events.begin();
    }
  }

  std::size_t size() const { return stretch_.samples.size(); }
  double Time(std::size_t i) const { return tracks_.t[stretch_.samples[i]]; }

  // Runs of samples between events, [first, last).
  std::vector<std::pair<std::size_t, std::size_t>> Sections() const {
    std::vector<std::pair<std::size_t, std::size_t>> out;
    for (std::size_t first = 0; first < size();) {
      std::size_t last = first + 1;
      while (last < size() && section_[last] == section_[first]) ++last;
      out.emplace_back(first, last);
      first = last;
    }
    return out;
  }

  // Log-likelihood of the innovations of [first, last) alone, started anew; `per_freedom` their
  // chi-square per degree of freedom.
  double LogLikelihood(std::size_t first, std::size_t last, double jerk,
                       double* per_freedom) const {
    Eigen::Matrix<double, 9, 1> x = Eigen::Matrix<double, 9, 1>::Zero();
    Matrix9 P;
    Begin(first, &x, &P);
    double sum = 0.0, chi_square = 0.0;
    std::size_t freedom = 0;
    for (std::size_t i = first + 1; i < last; ++i) {
      Carry(Time(i) - Time(i - 1), jerk, &x, &P);
      const std::size_t sample = stretch_.samples[i];
      const Eigen::Vector3d y = tracks_.p.col(static_cast<Eigen::Index>(sample)) - x.head<3>();
      const Eigen::Matrix3d S = P.topLeftCorner<3, 3>() + tracks_.Covariance(sample);
      const Eigen::LLT<Eigen::Matrix3d> llt(S);
      const double squared = llt.matrixL().solve(y).squaredNorm();
      // Three samples fix position, velocity and acceleration; their innovations tell nothing.
      if (i >= first + 3) {
        sum -= 0.5 * squared + llt.matrixLLT().diagonal().array().log().sum();
        chi_square += squared;
        freedom += 3;
      }
      const Eigen::Matrix<double, 9, 3> K =
          P.leftCols<3>() * llt.solve(Eigen::Matrix3d::Identity());
      x += K * y;
      P -= (K * P.topRows<3>()).eval();
      P = (0.5 * (P + P.transpose())).eval();
    }
    if (per_freedom != nullptr) {
      *per_freedom = freedom > 0 ? chi_square / static_cast<double>(freedom) : 0.0;
    }
    return sum;
  }

  // The process noise that makes the innovations likeliest: a search over decades, then golden
  // section between its neighbours.
  double LikeliestJerk(std::size_t first, std::size_t last) const {
    constexpr std::size_t kMost = 4000;  // samples looked at
    last = std::min(last, first + kMost);
    const auto value = [&](double log10) {
      return LogLikelihood(first, last, std::pow(10.0, log10), nullptr);
    };
    const double lowest = std::log10(scale_.least_jerk()), highest = std::log10(scale_.most_jerk());
    double best = lowest, best_value = -std::numeric_limits<double>::infinity();
    const int steps = static_cast<int>(std::floor(highest + 0.5 - lowest));
    for (int k = 0; k <= steps; ++k) {
      const double at = lowest + k;
      const double here = value(at);
      if (here > best_value) {
        best_value = here;
        best = at;
      }
    }
    const double golden = 0.5 * (std::sqrt(5.0) - 1.0);
    double low = best - 1.0, high = best + 1.0;
    double a = high - golden * (high - low), b = low + golden * (high - low);
    double fa = value(a), fb = value(b);
    while (high - low > 0.1) {
      if (fa > fb) {
        high = b;
        b = a;
        fb = fa;
        a = high - golden * (high - low);
        fa = value(a);
      } else {
        low = a;
        a = b;
        fa = fb;
        b = low + golden * (high - low);
        fb = value(b);
      }
    }
    return std::pow(10.0, 0.5 * (low + high));
  }

  // `jerk` per sample: of the interval that leads to it. Works on [first, last) and writes
  // position, covariance and factor of [from, to) within it.
  void Run(std::size_t first, std::size_t last, std::size_t from, std::size_t to,
           const std::vector<double>& jerk, data::Tracks* out) const {
    const Eigen::Index rank = tracks_.shared_rank, columns = 1 + rank;
    const std::size_t n = last - first;
    std::vector<Means> filtered(n), predicted(n);
    std::vector<Matrix9> P_filtered(n), P_predicted(n), F(n);
    Means x = Means::Zero(9, columns);
    Matrix9 P;
    for (std::size_t i = 0; i < n; ++i) {
      const std::size_t sample = stretch_.samples[first + i];
      const auto col = static_cast<Eigen::Index>(sample);
      F[i] = Matrix9::Identity();
      if (i == 0) {
        Eigen::Matrix<double, 9, 1> start = Eigen::Matrix<double, 9, 1>::Zero();
        Begin(first, &start, &P);
        x.col(0) = start;
        if (rank > 0) x.topRightCorner(3, rank) = tracks_.shared.middleCols(col * rank, rank);
        filtered[i] = x;
        P_filtered[i] = P;
        continue;
      }
      F[i] = Transition(Time(first + i) - Time(first + i - 1));
      x = (F[i] * x).eval();
      Across(first + i, jerk[first + i], &P);
      predicted[i] = x;
      P_predicted[i] = P;
      Eigen::Matrix3Xd z(3, columns);
      z.col(0) = tracks_.p.col(col);
      if (rank > 0) z.rightCols(rank) = tracks_.shared.middleCols(col * rank, rank);
      const Eigen::Matrix3d R = tracks_.Covariance(sample);
      const Eigen::Matrix3d S = P.topLeftCorner<3, 3>() + R;
      const Eigen::Matrix<double, 9, 3> K =
          P.leftCols<3>() * Eigen::LLT<Eigen::Matrix3d>(S).solve(Eigen::Matrix3d::Identity());
      x += K * (z - x.topRows<3>());
      // Joseph's form stays positive where the start knows nothing and samples a lot.
      Matrix9 I = Matrix9::Identity();
      I.leftCols<3>() -= K;
      P = (I * P * I.transpose() + K * R * K.transpose()).eval();
      filtered[i] = x;
      P_filtered[i] = P;
    }
    for (std::size_t i = n; i-- > 0;) {
      if (i + 1 < n) {
        const Matrix9 C = P_filtered[i] * F[i + 1].transpose();
        // Scaled, for position and acceleration are decades apart.
        const Eigen::Matrix<double, 9, 1> scale =
            P_predicted[i + 1].diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
        const Matrix9 scaled = scale.asDiagonal() * P_predicted[i + 1] * scale.asDiagonal();
        const Matrix9 G =
            (Eigen::LDLT<Matrix9>(scaled).solve(Matrix9(scale.asDiagonal() * C.transpose())))
                .transpose() *
            scale.asDiagonal();
        x = filtered[i] + G * (x - predicted[i + 1]);
        P = (P_filtered[i] + G * (P - P_predicted[i + 1]) * G.transpose()).eval();
        P = (0.5 * (P + P.transpose())).eval();
      }
      if (first + i < from || first + i >= to) continue;
      const auto col = static_cast<Eigen::Index>(stretch_.samples[first + i]);
      out->p.col(col) = x.col(0).head<3>();
      out->cov.col(col) << P(0, 0), P(0, 1), P(0, 2), P(1, 1), P(1, 2), P(2, 2);
      if (rank > 0) out->shared.middleCols(col * rank, rank) = x.topRightCorner(3, rank);
    }
  }

 private:
  // After the stretch's sample i alone.
  void Begin(std::size_t i, Eigen::Matrix<double, 9, 1>* x, Matrix9* P) const {
    x->setZero();
    x->head<3>() = tracks_.p.col(static_cast<Eigen::Index>(stretch_.samples[i]));
    P->setZero();
    P->topLeftCorner<3, 3>() = tracks_.Covariance(stretch_.samples[i]);
    P->diagonal().segment<3>(3).setConstant(std::pow(scale_.first_speed(), 2));
    P->diagonal().tail<3>().setConstant(std::pow(scale_.first_acceleration(), 2));
  }

  static void Carry(double dt, double jerk, Eigen::Matrix<double, 9, 1>* x, Matrix9* P) {
    const Matrix9 F = Transition(dt);
    *x = (F * *x).eval();
    *P = (F * *P * F.transpose()).eval();
    AddJerk(dt, jerk, P);
  }

  void Kick(Matrix9* P) const {
    P->diagonal().segment<3>(3).array() += std::pow(scale_.first_speed(), 2);
    P->diagonal().tail<3>().array() += std::pow(scale_.first_acceleration(), 2);
  }

  // The covariance from sample i - 1 to i. An event between them ends what is known of velocity and
  // acceleration at its instant; one that is known only roughly may come right after i - 1.
  void Across(std::size_t i, double jerk, Matrix9* P) const {
    const double sigma = options_.event_sigma;
    double at = Time(i - 1);
    bool perhaps = false;
    const auto carry = [&](double to) {
      const Matrix9 F = Transition(to - at);
      *P = (F * *P * F.transpose()).eval();
      AddJerk(to - at, jerk, P);
      at = to;
    };
    auto event = std::upper_bound(options_.events.begin(), options_.events.end(), at - sigma);
    for (; event != options_.events.end() && *event - sigma <= Time(i); ++event) {
      if (sigma == 0.0) carry(*event);
      Kick(P);
      perhaps = perhaps || sigma > 0.0;
    }
    carry(Time(i));
    if (perhaps) Kick(P);  // whenever it was in between, the speeds at both ends are two unknowns
  }

  const data::Tracks& tracks_;
  const Stretch& stretch_;
  const Scale& scale_;
  const SmoothOptions& options_;
  std::vector<std::ptrdiff_t> section_;
};

// Of one mark: its usable samples, a new stretch after each gap.
std::vector<Stretch> StretchesOf(const data::Tracks& tracks, std::int32_t mark, double longest) {
  std::vector<Stretch> out;
  for (std::size_t i : tracks.SamplesOf(mark)) {
    if (out.empty() || !(tracks.t[i] - tracks.t[out.back().samples.back()] <= longest)) {
      out.emplace_back();
    }
    out.back().samples.push_back(i);
  }
  return out;
}

// The process noise of each section: `given`, or where that is 0 the one of largest likelihood. A
// section too short to determine it takes the roughest of its neighbours, or smooths nothing.
std::vector<double> JerksOf(const StretchSmoother& smoother, const Scale& scale, double given) {
  constexpr std::size_t kEnough = 12;  // samples that determine their own process noise
  const auto sections = smoother.Sections();
  std::vector<double> found(sections.size(), given);
  for (std::size_t s = 0; s < sections.size() && given == 0.0; ++s) {
    const auto [first, last] = sections[s];
    if (last - first >= kEnough) found[s] = smoother.LikeliestJerk(first, last);
  }
  std::vector<double> jerks = found;
  for (std::size_t s = 0; s < sections.size(); ++s) {
    if (found[s] != 0.0) continue;
    if (s > 0) jerks[s] = std::max(jerks[s], found[s - 1]);
    if (s + 1 < sections.size()) jerks[s] = std::max(jerks[s], found[s + 1]);
    if (jerks[s] == 0.0) jerks[s] = scale.most_jerk();
  }
  return jerks;
}

}  // namespace

double IntervalOf(const data::Tracks& tracks) {
  std::vector<double> last(tracks.marks.size(), std::numeric_limits<double>::quiet_NaN());
  std::vector<double> steps;
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    if (!data::Usable(tracks.status[i])) continue;
    double& before = last[static_cast<std::size_t>(tracks.mark[i])];
    if (tracks.t[i] > before) steps.push_back(tracks.t[i] - before);
    before = tracks.t[i];
  }
  return steps.empty() ? 0.0 : Median(steps);
}

data::Tracks Smooth(const data::Tracks& tracks, const SmoothOptions& options,
                    SmoothReport* report) {
  constexpr double kGapIntervals = 20.0;  // between samples: twice the smoother's memory
  constexpr std::size_t kFewest = 4;      // samples that can be smoothed at all
  constexpr std::size_t kWindow = 2000;   // samples in memory at once
  constexpr std::size_t kOverlap = 200;   // the smoother's memory is some ten samples
  const double longest_gap =
      options.longest_gap > 0.0 ? options.longest_gap : kGapIntervals * IntervalOf(tracks);
  data::Tracks out = tracks;
  out.smoothed = true;
  if (report != nullptr) *report = {};
  for (std::size_t m = 0; m < tracks.marks.size(); ++m) {
    for (const Stretch& stretch : StretchesOf(tracks, static_cast<std::int32_t>(m), longest_gap)) {
      if (stretch.samples.size() < kFewest) continue;
      const Scale scale = ScaleOf(tracks, stretch);
      const StretchSmoother smoother(tracks, stretch, scale, options);
      const auto sections = smoother.Sections();
      const std::vector<double> found = JerksOf(smoother, scale, options.jerk);
      std::vector<double> jerk(smoother.size());
      for (std::size_t s = 0; s < sections.size(); ++s) {
        const auto [first, last] = sections[s];
        std::fill(jerk.begin() + static_cast<std::ptrdiff_t>(first),
                  jerk.begin() + static_cast<std::ptrdiff_t>(last), found[s]);
        if (report == nullptr) continue;
        report->sections.push_back({static_cast<int>(m), smoother.Time(first),
                                    smoother.Time(last - 1), last - first, found[s], 0.0});
        smoother.LogLikelihood(first, last, found[s], &report->sections.back().chi_square);
      }
      for (std::size_t from = 0; from < smoother.size(); from += kWindow) {
        const std::size_t to = std::min(smoother.size(), from + kWindow);
        smoother.Run(from > kOverlap ? from - kOverlap : 0,
                     std::min(smoother.size(), to + kOverlap), from, to, jerk, &out);
      }
    }
  }
  if (report != nullptr && !tracks.t.empty()) {
    for (double event : options.events) {
      if (event >= tracks.t.front() && event <= tracks.t.back()) report->events.push_back(event);
    }
  }
  return out;
}

}  // namespace unfurl::measure
