// Step 3 of a fit: from the end of the best way to the estimate.
#include <algorithm>
#include <cmath>

#include "correlate/fit/fit_covariance.h"
#include "correlate/fit/fit_estimate.h"
#include "correlate/fit/fit_run.h"
#include "correlate/fit/goodness.h"
#include "correlate/fit/reduced_problem.h"
#include "correlate/residual/row_layout.h"

namespace unfurl::correlate {

// What the solution begins with, the longest first; the tighter tolerance is that of the lowest
// rung.
std::vector<Evaluator::Request> FitRun::NoiseRequests() const {
  std::vector<Evaluator::Request> out = ladder_.FirstRequests(*best_);
  const std::vector<double> theta = Values(problem_.parameters, best_->u().data());
  for (std::size_t t = 0; t < trials_ && ladder_.result().base == 0; ++t) {
    if (problem_.trials[t].tighter == nullptr) continue;
    out.push_back({t, theta, "noise", Fidelity::kTighter});
  }
  return out;
}

void FitRun::WeighByModelNoise() {
  const std::vector<double> theta = Values(problem_.parameters, best_->u().data());
  for (std::size_t t = 0; t < trials_; ++t) {
    weighed_[t] = *problem_.trials[t].observations;
    data_[t] = &weighed_[t];
  }
  best_->evaluator().Evaluate(NoiseRequests());
  for (std::size_t t = 0; t < trials_; ++t) {
    const FitTrial& trial = problem_.trials[t];
    const Evaluator::Answer here =
        best_->evaluator().Evaluate({{t, theta, "trial", Fidelity::kMain}}).front();
    const Prediction& plain =
        here->status == ModelStatus::kGood ? *here : *best_->point().prediction[t];
    if (trial.tighter != nullptr && ladder_.result().base == 0) {
      const Evaluator::Answer tight =
          best_->evaluator().Evaluate({{t, theta, "noise", Fidelity::kTighter}}).front();
      if (tight->status == ModelStatus::kGood && here->status == ModelStatus::kGood) {
        noise_[t] = std::max(noise_[t], RmsDifference(plain, *tight));
        noise_sigmas_[t] = std::max(
            noise_sigmas_[t],
            RmsInSigmas(*trial.observations, best_->reduced().parts()[t].reference, plain, *tight));
        result_.trials[t].less_weight = WeighSections(*trial.observations, plain, *tight,
                                                      options_.error_sections, &weighed_[t]);
      }
    }
    result_.trials[t].model_noise = std::max(noise_[t], plain.noise);
  }
  best_->SetModelNoise(noise_sigmas_);
}

bool FitRun::Sharpen(const std::string& what) {
  if (!ladder_.wanted()) return best_->Sharpen(data_, whiteners_, what);
  return ladder_.Climb(*best_, data_, whiteners_, what);
}

// Channels of which no sigma is stated get the one that their residuals show: iteratively
// reweighted least squares, whose fixed point is the maximum of the likelihood over the unknown
// variances.
bool FitRun::ScaleChannels(std::vector<Observations>* all) {
  constexpr int kMostRounds = 4;     // two do where one channel's weight leads the others'
  constexpr double kSettled = 0.02;  // of a sigma: a weight that changes no estimate
  for (int round = 0; round < kMostRounds; ++round) {
    bool changed = false;
    for (std::size_t t = 0; t < trials_; ++t) {
      const Eigen::VectorXd& residual = best_->point().registration[t].residual;
      const RowLayout layout(weighed_[t]);
      for (std::size_t k = 0; k < weighed_[t].others.size(); ++k) {
        const auto& kind = weighed_[t].others[k];
        const Eigen::VectorXd own = residual.segment(layout.others[k], kind->rows());
        const auto scaled = kind->Rescaled(own);
        const double mean = own.squaredNorm() / std::max(1.0, static_cast<double>(own.size()));
        if (scaled == nullptr || std::abs(std::sqrt(mean) - 1.0) < kSettled) continue;
        weighed_[t].others[k] = scaled;
        (*all)[t].others[k] = scaled->Without({});
        changed = true;
      }
    }
    if (!changed) break;
    if (!Sharpen("with the noise that channels show")) return false;
  }
  return true;
}

namespace {
bool AlikePutAside(const GrossErrors& a, const GrossErrors& b) {
  return a.suspects.size() == b.suspects.size() &&
         std::equal(a.samples.begin(), a.samples.end(), b.samples.begin(), b.samples.end(),
                    [](const GrossSample& x, const GrossSample& y) {
                      return x.mark == y.mark && x.index == y.index;
                    });
}
}  // namespace

// Gross errors stick out of their neighbours' residuals however the fit is bent by them; what the
// bent fit hides shows in the next round. A fit that is bent by much has clean samples stick out,
// too, and all of them look like bursts of a wrong model: they are put aside once, and judged by
// the fit to the others.
bool FitRun::PutGrossAside(const std::vector<Observations>& all, bool first) {
  constexpr int kMostRounds = 4;  // two nearly always do
  if (!options_.robust) return true;
  RegistrationOptions stay = options_.align.registration;
  stay.with_others = true;
  stay.max_iterations = 0;
  for (int round = 0; round < kMostRounds; ++round) {
    bool changed = false;
    for (std::size_t t = 0; t < trials_; ++t) {
      const Eigen::VectorXd residual = FitRegistration(all[t], *best_->point().prediction[t],
                                                       best_->reduced().parts()[t].reference,
                                                       best_->point().registration[t].at, stay)
                                           .residual;
      GrossErrors found = FindGrossErrors(all[t], residual);
      std::vector<ChannelGross> readings = FindChannelGross(all[t], residual);
      const bool once = first && round == 0;
      if (!once) {
        found.suspects.clear();
        for (ChannelGross& one : readings) one.errors.suspects.clear();
      }
      TrialResult& known = result_.trials[t];
      changed = changed || (once && AnyFar(t)) || !AlikePutAside(found, known.gross) ||
                !std::equal(readings.begin(), readings.end(), known.channel_gross.begin(),
                            known.channel_gross.end(), [](const auto& a, const auto& b) {
                              return a.kind == b.kind && AlikePutAside(a.errors, b.errors);
                            });
      known.gross = std::move(found);
      known.channel_gross = std::move(readings);
      weighed_[t] = all[t];
      PutAside(known.gross, &weighed_[t]);
      PutAside(known.channel_gross, &weighed_[t]);
    }
    if (!changed) break;
    if (!Sharpen("gross errors put aside")) return false;
  }
  return true;
}

bool FitRun::TakeClockDrift() {
  // What a bound leaves in the residuals is the bound's, and no clock's.
  for (std::size_t j = 0; j < problem_.parameters.size(); ++j) {
    const Parameter& p = problem_.parameters[j];
    const double u = best_->u()[j];
    for (const double bound : {p.low, p.high}) {
      const bool finite = std::isfinite(bound) && (!p.log || bound > 0.0);
      constexpr double kRoundOff = 1e-9;  // of the bound
      if (finite && std::abs(u - ToInternal(p, bound)) <= kRoundOff * (1.0 + std::abs(u)))
        return true;
    }
  }
  Eigen::MatrixXd J;
  std::vector<double> kinks;
  if (!best_->reduced().CentralSensitivity(best_->u(), best_->point(), &J, &kinks)) return false;
  const std::vector<DriftTest> tests =
      TestClockDrift(best_->reduced(), best_->point(), J, options_.align.registration,
                     options_.clock_sigma, *std::max_element(kinks.begin(), kinks.end()));
  bool called = false;
  for (std::size_t t = 0; t < trials_; ++t) {
    result_.trials[t].drift = tests[t];
    if (!tests[t].called) continue;
    called = true;
    weighed_[t].placement.drift = Prior::Normal(0.0, options_.clock_sigma);
  }
  return !called || Sharpen("with a clock drift");
}

bool FitRun::Whiten() {
  Eigen::MatrixXd J;
  if (!best_->reduced().CentralSensitivity(best_->u(), best_->point(), &J)) return false;
  bool coloured = false;
  for (std::size_t t = 0; t < trials_; ++t) {
    const RegistrationFit& at = best_->point().registration[t];
    const Eigen::Index rows = at.residual.size();
    if (at.SumOfSquares() > kNotNoise * static_cast<double>(at.data_rows)) continue;
    Eigen::MatrixXd A(rows, J.cols() + at.jacobian.cols());
    A << J.middleRows(best_->reduced().first_row(t), rows), at.jacobian;
    result_.trials[t].noise = Believed(FitSeriesNoise(weighed_[t], at.residual, A), weighed_[t]);
    whitening_[t] = RowWhitening(weighed_[t], result_.trials[t].noise);
    whiteners_[t] = &whitening_[t];
    coloured = coloured || !whitening_[t].identity();
  }
  return !coloured || Sharpen("whitened");
}

// Whitened residuals have unit variance where their noise was found. Where the fit has left a wrong
// minimum they are smaller: what was taken for noise there was that minimum's misfit.
bool FitRun::NoiseIsOfAnotherPlace() const {
  constexpr double kByChance = 5.0;  // standard deviations of a mean square: one in three million
  for (const RegistrationFit& at : best_->point().registration) {
    const double n = static_cast<double>(at.data_rows);
    if (at.SumOfSquares() < n - kByChance * std::sqrt(2.0 * n)) return true;
  }
  return false;
}

void FitRun::TakeStatus() {
  result_.status = best_->status();
  result_.message = best_->message();
  result_.ladder = ladder_.result();
  const bool lost =
      ladder_.wanted() && !ladder_.result().settled && ladder_.correction() != nullptr;
  if (!lost || result_.status != FitStatus::kConverged) return;
  result_.status = FitStatus::kNotConverged;
  result_.message =
      ladder_.result().notes.empty() ? "the ladder did not settle" : ladder_.result().notes.back();
}

bool FitRun::Solve() {
  workers_.Phase("polishing", budget_.sharpening + budget_.profiles);
  if (ladder_.correction() == nullptr) {
    // At the stamps of what follows, so that it begins with what is asked here.
    std::vector<const Observations*> way;
    for (const FitTrial& trial : way_.trials) way.push_back(trial.observations);
    best_->Place(way, std::vector<const RowWhitening*>(trials_, nullptr));
  }
  best_->Polish(NoiseRequests());
  workers_.Phase("sharpening", budget_.sharpening + budget_.profiles);
  const bool whitened = std::any_of(whiteners_.begin(), whiteners_.end(),
                                    [](const auto* w) { return w != nullptr && !w->identity(); });
  if (whitened) {  // a return: the cost by which the point is lower must stay what it is
    const bool good = Sharpen("from a lower point of a profile");
    if (!good || !NoiseIsOfAnotherPlace()) {
      TakeStatus();
      return good;
    }
  }
  WeighByModelNoise();
  std::fill(whiteners_.begin(), whiteners_.end(), nullptr);
  for (TrialResult& trial : result_.trials) trial.gross = {}, trial.channel_gross = {};
  std::vector<Observations> all = weighed_;
  for (std::size_t t = 0; t < trials_; ++t) weighed_[t] = WithoutFar(all[t], t);
  // Gross errors before noise, of which they would be taken for a part; and after it, since that
  // is how the channels of a trial are weighed.
  const bool good = Sharpen("sharpened") && PutGrossAside(all, true) && ScaleChannels(&all) &&
                    PutGrossAside(all, false) && TakeClockDrift() && (!options_.whiten || Whiten());
  TakeStatus();
  return good;
}

}  // namespace unfurl::correlate
