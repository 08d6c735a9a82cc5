#include "correlate/fit/profile.h"

#include <algorithm>
#include <cmath>

#include "base/dense.h"
#include "correlate/fit/interval.h"
#include "correlate/fit/profile_lane.h"

namespace unfurl::correlate {

namespace {

constexpr double kSettled = 0.01;  // of deviance: what the next step would still gain
constexpr double kRough = 0.1;     // the same of a rough model: 1.3% of an interval's half width
constexpr int kMostSteps = 12;     // of one point
constexpr int kChordSteps = 3;     // with sensitivities of the estimate, before new ones are taken

using Lane = ProfileLane;

class Follower {
 public:
  Follower(ReducedProblem& problem, const ProfileStart& start, const ProfileOptions& options)
      : problem_(problem),
        start_(start),
        options_(options),
        p_(problem.parameters().size()),
        normal_(start.projected.transpose() * start.projected),
        profiles_(p_) {}

  std::vector<Profile> Run() {
    std::vector<Lane> lanes;
    for (std::size_t j = 0; j < p_; ++j) {
      for (double side : {-1.0, 1.0}) {
        for (double level : options_.levels) lanes.push_back(Open(j, side * level, {}));
      }
    }
    std::vector<Lane> done;
    while (!lanes.empty()) {
      Settle(&lanes);
      std::vector<Lane> next;
      for (Lane& lane : lanes) done.push_back(std::move(lane));
      for (std::size_t j = 0; j < p_; ++j) {
        for (double side : {-1.0, 1.0}) Extend(j, side, done, &next);
      }
      lanes = std::move(next);
    }
    for (std::size_t j = 0; j < p_; ++j) Summarise(j, done);
    return std::move(profiles_);
  }

 private:
  const Parameter& Of(std::size_t j) const { return problem_.parameters()[j]; }

  // As near to a bound as anything goes.
  bool AtEnd(std::size_t j, double u, double side) const {
    constexpr double kRoundOff = 1e-9;  // of the value and the standard error
    const double room =
        side < 0.0 ? StepToLowest(Of(j), start_.u[j]) : StepToHighest(Of(j), start_.u[j]);
    const double left = std::abs(room - ValueStep(Of(j), start_.u[j], u));
    return left <= kRoundOff * std::max(std::abs(room), start_.sigma(static_cast<Eigen::Index>(j)));
  }

  // The others where the linear model, or two points already found, say.
  // `to_end`: as far as the bound, whatever the level.
  Lane Open(std::size_t j, double level, const std::vector<const Lane*>& nearer,
            bool to_end = false) const {
    Lane lane;
    lane.held = j;
    lane.level = level;
    lane.u = start_.u;
    const auto column = static_cast<Eigen::Index>(j);
    double distance = level * start_.sigma(column);
    if (Of(j).log && !to_end) {  // far below, a model may be another one
      distance = ValueStep(Of(j), start_.u[j], StepAsymptotic(Of(j), start_.u[j], distance));
    }
    const double at = StepByValue(Of(j), start_.u[j], distance);
    lane.at_bound = AtEnd(j, at, level);
    distance = ValueStep(Of(j), start_.u[j], at);
    if (!nearer.empty()) {
      // The parabola (or the line) through the estimate and the nearest points found.
      const Lane& a = *nearer[0];
      auto step = [&](const Lane& of, std::size_t l) {
        return ValueStep(Of(l), start_.u[l], of.u[l]);
      };
      const double da = step(a, j);
      for (std::size_t l = 0; l < p_; ++l) {
        const double slope_a = step(a, l) / da;
        double slope = slope_a;
        if (nearer.size() > 1) {
          const double db = step(*nearer[1], j), slope_b = step(*nearer[1], l) / db;
          slope += (slope_a - slope_b) / (da - db) * (distance - da);
        }
        lane.u[l] = StepByValue(Of(l), start_.u[l], slope * distance);
      }
    } else {
      const Eigen::VectorXd others =
          SolveOthers(normal_, j, -normal_.col(column) * distance, start_.u);
      for (std::size_t l = 0; l < p_; ++l) {
        lane.u[l] = StepByValue(Of(l), start_.u[l], others(static_cast<Eigen::Index>(l)));
      }
    }
    lane.u[j] = at;
    lane.trial = lane.u;
    return lane;
  }

  // Least squares over all but parameter j, from u; its entry is 0. What would leave its bounds
  // stays at them, and the others are at their best for that. Directions without information stay.
  Eigen::VectorXd SolveOthers(const Eigen::MatrixXd& normal, std::size_t j,
                              const Eigen::VectorXd& right, const std::vector<double>& u) const {
    Eigen::VectorXd out = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(p_));
    std::vector<Eigen::Index> keep, held;
    for (Eigen::Index l = 0; l < out.size(); ++l) {
      if (l != static_cast<Eigen::Index>(j)) keep.push_back(l);
    }
    while (!keep.empty()) {
      const Eigen::MatrixXd H = normal(keep, keep);
      const Eigen::VectorXd wanted = right(keep) - normal(keep, held) * out(held);
      const Eigen::VectorXd scale = H.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
      Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> decomposition;
      decomposition.setThreshold(1e-9);
      decomposition.compute(scale.asDiagonal() * H * scale.asDiagonal());
      out(keep) = scale.asDiagonal() * decomposition.solve(scale.asDiagonal() * wanted);
      const std::size_t before = held.size();
      std::vector<Eigen::Index> free;
      for (const Eigen::Index l : keep) {
        const auto at = static_cast<std::size_t>(l);
        const double bounded =
            std::clamp(out(l), StepToLowest(Of(at), u[at]), StepToHighest(Of(at), u[at]));
        (bounded == out(l) ? free : held).push_back(l);
        out(l) = bounded;
      }
      if (held.size() == before) break;
      keep = std::move(free);
    }
    return out;
  }

  // Steps of all lanes side by side until each has settled, failed or spent its steps.
  void Settle(std::vector<Lane>* lanes) {
    for (;;) {
      std::vector<Lane*> active;
      std::vector<std::vector<double>> trials;
      for (Lane& lane : *lanes) {
        if (lane.done) continue;
        active.push_back(&lane);
        trials.push_back(lane.trial);
      }
      if (active.empty()) return;
      spent_ += static_cast<int>(active.size());
      std::vector<ReducedProblem::Point> points;
      const std::vector<bool> good = problem_.AtAll(trials, &points, "profile");
      for (std::size_t i = 0; i < active.size(); ++i) Advance(*active[i], good[i], points[i]);
    }
  }

  void Advance(Lane& lane, bool good, const ReducedProblem::Point& point) {
    const bool first = !std::isfinite(lane.cost);
    ++lane.steps;
    ++lane.since_fresh;
    if (good && point.cost < lane.cost) {
      lane.cost = point.cost;
      lane.u = lane.trial;
      lane.residual = point.residual;
      lane.shrink = std::min(1.0, 2.0 * lane.shrink);
    } else if (first) {
      lane.failed = lane.done = true;  // a failed evaluation there: recorded, and the end of it
      return;
    } else {
      lane.shrink *= 0.5;
    }
    if (p_ == 1) {
      lane.done = lane.settled = true;
      return;
    }
    const bool stuck = lane.shrink < 0.2;
    if (stuck || lane.since_fresh > kChordSteps) {
      if (!Refresh(lane)) {
        lane.done = true;
        return;
      }
    }
    const bool own = lane.J.size() > 0;
    const Eigen::MatrixXd& J = own ? lane.J : start_.projected;
    // What a value's change does stays; per unit of a logarithm it grows with the value.
    Eigen::VectorXd grown = Eigen::VectorXd::Ones(static_cast<Eigen::Index>(p_));
    for (std::size_t l = 0; l < p_; ++l) {
      const double from = own ? lane.u_of_J[l] : start_.u[l];
      if (Of(l).log) grown(static_cast<Eigen::Index>(l)) = std::exp(lane.u[l] - from);
    }
    const Eigen::MatrixXd normal = grown.asDiagonal() *
                                   (own ? Eigen::MatrixXd(J.transpose() * J) : normal_) *
                                   grown.asDiagonal();
    const Eigen::VectorXd gradient = grown.cwiseProduct(J.transpose() * lane.residual);
    const Eigen::VectorXd step = SolveOthers(normal, lane.held, -gradient, lane.u);
    lane.trial = lane.u;
    double moved = 0.0;
    for (std::size_t l = 0; l < p_; ++l) {
      if (l == lane.held) continue;
      const double s = lane.shrink * step(static_cast<Eigen::Index>(l));
      lane.trial[l] = StepByValue(Of(l), lane.u[l], s);
      moved -= gradient(static_cast<Eigen::Index>(l)) * ValueStep(Of(l), lane.u[l], lane.trial[l]);
    }
    // Of the model's scatter the share that looks like changes of the parameters is no gain.
    const double settled = std::clamp(start_.scatter, kSettled, kRough);
    lane.settled = moved <= settled * start_.dispersion(static_cast<Eigen::Index>(lane.held));
    lane.done = lane.settled || lane.steps >= kMostSteps || spent_ >= options_.max_evaluations;
  }

  // Sensitivities where the lane stands: a curved valley is not the estimate's straight one.
  bool Refresh(Lane& lane) {
    ReducedProblem::Point point;
    if (!problem_.At(lane.u, &point, "profile")) return false;
    Eigen::MatrixXd J;
    if (!problem_.Sensitivity(lane.u, point, +1, &J)) return false;
    spent_ += static_cast<int>(p_);
    lane.J = problem_.Project(point, J);
    lane.u_of_J = lane.u;
    lane.residual = point.residual;
    lane.shrink = 1.0;
    lane.since_fresh = 0;
    return true;
  }

  double Deviance(const Lane& lane) const { return 2.0 * (lane.cost - start_.point.cost); }

  // The lanes of one side that settled, nearest to the estimate first.
  std::vector<const Lane*> SettledOn(std::size_t j, double side,
                                     const std::vector<Lane>& done) const {
    std::vector<const Lane*> out;
    for (const Lane& lane : done) {
      if (lane.held == j && lane.level * side > 0.0 && lane.settled && lane.u[j] != start_.u[j]) {
        out.push_back(&lane);
      }
    }
    std::sort(out.begin(), out.end(),
              [](const Lane* a, const Lane* b) { return std::abs(a->level) < std::abs(b->level); });
    return out;
  }

  void Extend(std::size_t j, double side, const std::vector<Lane>& done,
              std::vector<Lane>* next) const {
    if (spent_ >= options_.max_evaluations) return;
    const std::vector<const Lane*> settled = SettledOn(j, side, done);
    const double reached = settled.empty() ? 0.0 : std::abs(settled.back()->level);
    double lost = std::numeric_limits<double>::infinity();  // the nearest beyond that is lost
    for (const Lane& lane : done) {
      const double level = std::abs(lane.level);
      if (lane.held == j && lane.level * side > 0.0 && !lane.settled && level > reached) {
        lost = std::min(lost, level);
      }
    }
    if (!settled.empty()) {
      const Lane& far = *settled.back();
      const Parameter& parameter = problem_.parameters()[j];
      const double value = FromInternal(parameter, start_.u[j]);
      const double away = std::abs(FromInternal(parameter, far.u[j]) - value);
      const double level95 = kDeviance95 * start_.dispersion(static_cast<Eigen::Index>(j));
      if (Deviance(far) >= level95) {
        Narrow(j, side, done, level95, next);
        return;
      }
      // Twice as far as a parabola takes to the level; and no nearer than it could be called known.
      const bool flat = reached >= 2.0 * kHalf95;
      if (far.at_bound || (flat && away >= 2.0 * KnownWithin(parameter, value))) return;
    }
    constexpr double kShortest = 0.05;  // of the first level: beyond that, it cannot be followed
    const double first = options_.levels.empty() ? 1.0 : options_.levels.front();
    double level = std::isfinite(lost) ? 0.5 * (reached + lost) : 1.6 * reached;
    if (std::isfinite(lost) && lost - reached < kShortest * first) return;
    if (!(level > reached)) return;
    std::vector<const Lane*> nearest(
        settled.rbegin(), settled.rbegin() + std::min<std::ptrdiff_t>(2, std::ssize(settled)));
    // A logarithm's logarithm has no end: where the slopes lead to nothing at all, so far.
    const double step = level * start_.sigma(static_cast<Eigen::Index>(j));
    const bool to_end = Of(j).log && side < 0.0 && step >= 1.0 && !std::isfinite(lost);
    next->push_back(Open(j, side * level, nearest, to_end));
  }

  // A point that lies far above the 95% level tells nothing of where the profile passes it, unless
  // that is a parabola: where another parameter has come to its bound it rises all at once.
  // Half-way to the point below, until it does not lie so far above.
  void Narrow(std::size_t j, double side, const std::vector<Lane>& done, double level95,
              std::vector<Lane>* next) const {
    constexpr double kFar = 2.0;        // of the level, squared: 1.4 standard errors of a parabola
    constexpr double kShortest = 1e-3;  // of the standard error: no interval shows it
    const std::vector<const Lane*> settled = SettledOn(j, side, done);
    const auto above = std::find_if(settled.begin(), settled.end(),
                                    [&](const Lane* lane) { return Deviance(*lane) >= level95; });
    const double low = above == settled.begin() ? 0.0 : std::abs((*(above - 1))->level);
    const double high = std::abs((*above)->level);
    const double root = std::sqrt(Deviance(**above));
    const double root_below =
        above == settled.begin() ? 0.0 : std::sqrt(std::max(Deviance(**(above - 1)), 0.0));
    // Where it rises so much faster than it did, the straight line between the two may pass the
    // level far too early.
    constexpr double kBent = 2.0;    // times as fast: another's bound, and no curvature
    constexpr double kShows = 0.03;  // of an interval's half
    const double straight =
        low + (std::sqrt(level95) - root_below) / (root - root_below) * (high - low);
    const bool bent = (root - root_below) * low > kBent * root_below * (high - low) &&
                      high - straight > kShows * high;
    const bool far = root * root >= kFar * level95;
    if ((!far && !bent) || high - low < kShortest * high) return;
    const bool lost = std::any_of(done.begin(), done.end(), [&](const Lane& lane) {
      const double level = lane.level * side;
      return lane.held == j && !lane.settled && level > low && level < high;
    });
    if (lost) return;
    std::vector<const Lane*> nearest;
    if (above != settled.begin()) nearest.push_back(*(above - 1));
    next->push_back(Open(j, side * 0.5 * (low + high), nearest));
  }

  void Summarise(std::size_t j, const std::vector<Lane>& done) {
    Profile& profile = profiles_[j];
    const Parameter& parameter = problem_.parameters()[j];
    profile.dispersion = start_.dispersion(static_cast<Eigen::Index>(j));
    struct Root {
      double value, root;  // signed square root of the deviance: straight where it is a parabola
    };
    std::vector<Root> roots = {{FromInternal(parameter, start_.u[j]), 0.0}};
    ProfilePoint centre;
    centre.value = FromInternal(parameter, start_.u[j]);
    centre.theta = Values(problem_.parameters(), start_.u.data());
    centre.settled = true;
    profile.points.push_back(centre);
    profile.reached_low = profile.reached_high = centre.value;
    for (const Lane& lane : done) {
      if (lane.held != j || lane.failed || lane.u[j] == start_.u[j]) continue;
      ProfilePoint point;
      point.value = FromInternal(parameter, lane.u[j]);
      point.deviance = Deviance(lane);
      point.theta = Values(problem_.parameters(), lane.u.data());
      point.settled = lane.settled;
      if (lane.settled) {
        profile.reached_low = std::min(profile.reached_low, point.value);
        profile.reached_high = std::max(profile.reached_high, point.value);
      }
      if (lane.settled)
        roots.push_back(
            {point.value, std::copysign(std::sqrt(std::max(point.deviance, 0.0)), lane.level)});
      profile.points.push_back(std::move(point));
    }
    std::sort(profile.points.begin(), profile.points.end(),
              [](const ProfilePoint& a, const ProfilePoint& b) { return a.value < b.value; });
    std::sort(roots.begin(), roots.end(),
              [](const Root& a, const Root& b) { return a.value < b.value; });
    const double wanted = std::sqrt(kDeviance95 * profile.dispersion);
    const auto middle = static_cast<std::size_t>(
        std::find_if(roots.begin(), roots.end(),
                     [&](const Root& r) { return r.value == centre.value; }) -
        roots.begin());
    auto cross = [&](const Root& a, const Root& b) {  // between a and b, straight in the root
      const double part = (wanted - std::abs(a.root)) / (std::abs(b.root) - std::abs(a.root));
      return a.value + part * (b.value - a.value);
    };
    for (std::size_t i = middle; i + 1 < roots.size(); ++i) {
      if (roots[i + 1].root >= wanted) {
        profile.high = cross(roots[i], roots[i + 1]);
        break;
      }
    }
    for (std::size_t i = middle; i > 0; --i) {
      if (-roots[i - 1].root >= wanted) {
        profile.low = cross(roots[i], roots[i - 1]);
        break;
      }
    }
    auto reached_end = [&](double* reached, double side) {
      const double away = std::abs(*reached - centre.value);
      if (AtEnd(j, ToInternal(parameter, *reached), side)) {
        *reached = side < 0.0 ? parameter.low : parameter.high;
        return true;
      }
      return away >= 2.0 * KnownWithin(parameter, centre.value);
    };
    profile.lost_low = profile.low != profile.low && !reached_end(&profile.reached_low, -1.0);
    profile.lost_high = profile.high != profile.high && !reached_end(&profile.reached_high, 1.0);
  }

  ReducedProblem& problem_;
  const ProfileStart& start_;
  const ProfileOptions& options_;
  std::size_t p_;
  Eigen::MatrixXd normal_;
  std::vector<Profile> profiles_;
  int spent_ = 0;
};

}  // namespace

std::vector<Profile> Profiles(ReducedProblem& problem, const ProfileStart& start,
                              const ProfileOptions& options) {
  return Follower(problem, start, options).Run();
}

}  // namespace unfurl::correlate
