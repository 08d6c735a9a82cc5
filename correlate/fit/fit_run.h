#pragma once

#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "correlate/align/far_samples.h"
#include "correlate/fit/fit.h"
#include "correlate/fit/ladder.h"
#include "correlate/fit/progress_workers.h"
#include "correlate/fit/search.h"

namespace unfurl::correlate {

// Mean square of residuals in sigmas above which they are the model's error and no noise: an
// alignment draws the same line. Whitening with a noise model fitted to them would weigh down the
// very data that hold frame and calibration.
inline constexpr double kNotNoise = 4.0;

// The steps of one fit, in the order in which Fit() takes them; each leaves what the next needs.
// The problem and the options must outlive it.
class FitRun {
 public:
  FitRun(const FitProblem& problem, const FitOptions& options);

  // 1. Where the data lie beside the model at each point screened; from the best of them starts are
  //    carried on. False: the data and the model share nothing at any of them.
  bool Screen();
  // After step 1, where it has found none: not because the model failed.
  bool NotAligned() const { return result_.status == FitStatus::kNotAligned; }
  // After step 1: over the first horizon the study's own start explains what an alignment asks of
  // one history.
  bool StartExplains() const;
  // After step 2: where it led lies beside the whole record, as an alignment asks.
  bool LiesBesideRecord(std::string* why = nullptr);

  // 2. Each start through the growing horizon. What the first stage leaves open is scattered over
  //    its bounds before the second. False: the model failed on every way.
  bool LeadStarts();

  // 3. The lowest end, to the floor of a rough cost; then solved to within the step tolerance with
  //    samples weighed for the model's own noise and rows whitened by the noise found in the
  //    residuals. False: a model failed there.
  bool Solve();

  // Ways of the study's start from other places in time, with these options; no step need be taken.
  std::vector<FitOptions> OtherBeginnings(const FitOptions& options);
  // After step 2: whether what it led to is not far above the data's sigmas; whether it explains
  // the data better, beyond the 95% level, than what another led to.
  bool WayExplains() const;
  bool ExplainsBetterThan(FitRun& other);

  // After step 3: the residuals are far above the data's sigmas.
  bool Unexplained() const;
  // After step 4: what is left is no noise, and larger or longer-lived than a stated sigma says, or
  // there is none.
  bool UnexplainedByNoiseFound() const;
  // After step 4: of some parameter most is told by samples between which the model moves by what
  // they do not show, and residuals have no stated size to be judged by.
  bool HidesMotion() const;
  // The same of residuals of a stated size, and the samples that show the motion leave it open.
  bool WantsSearch() const;
  // Values to which the starts have led, the lowest first.
  std::vector<std::vector<double>> Ends() const;
  // Leads on from such values; what is as good as the estimate is weighed with the other offsets.
  void LookAtEnds(const std::vector<std::vector<double>>& ends);
  // After step 2: the ways led to a lower cost over the whole record than the other's.
  bool LedLowerThan(FitRun& other) const;
  // The other was a search of the same that led no lower; what it evaluated is recorded.
  void TakeOver(FitRun&& other, Elsewhere found);

  // 4. Sensitivities at the estimate, the model's own error, covariance, profiles. False: a model
  //    failed beside the estimate. `searched`: the bounds may be looked over afterwards.
  bool Estimate(bool searched);

  // 5. A profile that came upon a lower point has shown that the estimate is not the minimum: goes
  //    there. True: step 3 has to be taken again.
  bool GoToBetterPoint();

  // Which other offsets, and values, explain the data as well, by the noise found.
  void WeighOtherClocks();

  // 6. Verdicts.
  void JudgeParameters();
  // 7. Nothing is a result where an alignment would say that the two share nothing.
  void JudgeEnd();

  FitResult Finish();

 private:
  // Evaluations of each step, as far as can be told beforehand: for the progress alone.
  struct Budget {
    std::size_t screening = 0, leading = 0, sharpening = 0, profiles = 0;
  };
  static Budget BudgetOf(const FitProblem& problem, const FitOptions& options);

  void AddRunner(const Candidate& from);
  void LeadAll(std::size_t from_stage, std::size_t to_stage);
  void ScatterWhatIsOpen();
  void DropTwins();  // after the first stage: those that stand where a better one does
  // After the starts were led: looks at other time offsets, and goes over to one that is lower.
  void LookAtOtherClocks();
  StageRunner* LeadAlong(Candidate place);   // null: it leads to nothing like the best
  double DevianceByWay(StageRunner& other);  // above the best's
  // What the model does between the samples, where residuals have no stated size to be judged by.
  void LookBetweenSamples();
  // Of each parameter, how much of what is known of it samples tell that do not show the motion.
  Eigen::VectorXd HiddenShare() const;
  // Most of what is known of some parameter is told by samples that do not show the motion.
  bool MostIsHidden() const;
  // Of parameters and nuisances, by the samples that show the motion (and the bounds).
  Eigen::MatrixXd CovarianceOfWhatShows(bool with_bounds) const;
  // The estimate, and values that those samples leave open about it.
  std::vector<std::vector<double>> PlacesByWhatShows() const;
  bool ComesBack();  // from there to one minimum
  // Whether the errors have to be those of the samples that show; what that adds to the doubt.
  bool RestsOnWhatHides(bool searched, Eigen::MatrixXd* doubt);
  // The estimate's place in time and space, with these values.
  Candidate PlaceAt(const std::vector<double>& theta) const;
  // After the verdicts: where the residuals may be what is left of a motion that samples hide.
  void OpenWhatIsHidden();
  double CostOfWay();
  std::vector<Evaluator::Request> NoiseRequests() const;  // where the best start has led
  void WeighByModelNoise();
  bool Sharpen(const std::string& what);  // by the ladder where there is one
  bool ScaleChannels(std::vector<Observations>* all);
  bool PutGrossAside(const std::vector<Observations>& all, bool first);
  bool TakeClockDrift();
  bool Whiten();
  bool NoiseIsOfAnotherPlace() const;
  void TakeStatus();
  void CountRuns();
  bool FarFrom(const std::vector<double>& theta) const;

  // What is far from its neighbours counts for what it is off by until a fit can judge it.
  static std::vector<std::vector<FarSample>> FarOf(const FitProblem& problem, bool robust);
  FitProblem Way();
  bool AnyFar(std::size_t trial) const;
  Observations WithoutFar(const Observations& all, std::size_t trial) const;

  const FitProblem& problem_;
  const FitOptions& options_;
  const std::size_t trials_;
  const std::vector<std::vector<FarSample>> far_;                    // by trial
  std::vector<std::vector<std::vector<std::size_t>>> far_readings_;  // by trial and kind
  std::vector<Observations> widened_;  // by trial, where there are far samples
  const FitProblem way_;               // the problem with those, to the first minimum
  std::unique_ptr<Workers> local_;
  ProgressWorkers workers_;
  Budget budget_;
  FitResult result_;

  std::vector<Candidate> candidates_;
  std::vector<double> noise_;         // of the model's marks, by trial [m]
  std::vector<double> noise_sigmas_;  // of all, in sigmas of the data [-]
  std::vector<std::unique_ptr<StageRunner>> runners_, retired_;
  std::vector<std::uint8_t> failed_;                        // by runner
  std::vector<std::unique_ptr<Candidate>> other_places_;    // of the next
  std::vector<std::unique_ptr<StageRunner>> other_clocks_;  // from other time offsets
  struct AsGood {
    StageRunner* runner;
    double deviance;  // by the way
    bool elsewhere;   // at another offset
  };
  std::vector<AsGood> as_good_;     // of those
  StageRunner* best_ = nullptr;     // among the runners
  std::optional<double> way_cost_;  // CostOfWay of the best, once it was asked
  Ladder ladder_;

  std::vector<Observations> weighed_;  // by trial, weighed for the model's noise
  std::vector<const Observations*> data_;
  std::vector<RowWhitening> whitening_;
  std::vector<const RowWhitening*> whiteners_;  // null: white
  int returns_ = 0;                             // to a better point of a profile
};

}  // namespace unfurl::correlate
