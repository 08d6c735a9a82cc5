#pragma once

#include <memory>
#include <string>
#include <vector>

#include "correlate/design/planned_trial.h"
#include "study/design.h"
#include "study/scene_model.h"

namespace unfurl::study {

/// Plans trials in the manner of one of a fit's. What it is made of must outlive it.
class Planner {
 public:
  Planner(const data::Study& study, const DesignOptions& options, const StudyFit& fit,
          const correlate::Contributions& tells, std::size_t trial)
      : study_(study), options_(options), fit_(fit), trial_(trial) {
    basis_.problem = &fit.problem();
    basis_.fit = &fit.result;
    basis_.options = &fit.binding->options;
    basis_.trial = trial;
    for (std::size_t j = 0; j < tells.sigma.size(); ++j) {
      growth_.push_back(fit.result.parameters[j].sigma_data / tells.sigma[j]);
    }
  }

  /// Of the trial at hand.
  const correlate::Observations& record() const {
    return *fit_.problem().trials[trial_].observations;
  }

  /// The strobe's cycle, as it was given or as the record shows it; notes it in `out`.
  void TakeCycle(StudyDesign* out);
  /// Marks that could be lit in every line; without a strobe, at the stamps of those at hand.
  std::vector<correlate::PlannedMark> Marks(const std::vector<std::string>& names) const;
  /// With the noise that the fit found where none is stated.
  std::vector<correlate::ChannelRecord> ChannelsAtHand() const;
  /// The scene on the finest rung with more keys set; the fit's own model where none are.
  const correlate::Model& Model(const std::vector<std::string>& set);
  /// Of a run of the model; null: not known.
  const std::vector<data::Quantity>* Quantities(const correlate::Model& model) const;
  /// See correlate::PlannedTrial.
  correlate::PlannedTrial Plan(const correlate::Model& model,
                               const correlate::PlannedContent& content) const {
    return {basis_, model, content, weight_};
  }
  /// What a choice of the planned leaves open.
  DesignCase Case(const std::string& name, const correlate::PlannedTrial& plan,
                  const correlate::Choice& choice) const {
    DesignCase out;
    out.name = name;
    out.alone = Grown(correlate::PlannedErrors(basis_, plan, choice, false));
    out.together = Grown(correlate::PlannedErrors(basis_, plan, choice, true));
    return out;
  }
  /// What correlation the residuals of the fit still have makes its errors larger than those of
  /// independent rows; it is taken to do the same to those of a plan.
  std::vector<double> Grown(const Eigen::VectorXd& sigma) const {
    std::vector<double> out(sigma.begin(), sigma.end());
    for (std::size_t j = 0; j < out.size(); ++j) out[j] *= growth_[j];
    return out;
  }
  /// By that, by parameter [-].
  const std::vector<double>& growth() const { return growth_; }
  /// Marks by slot as a choice; `instruments`: which are recorded.
  correlate::Choice ChoiceOf(const std::vector<int>& cycle, std::size_t marks,
                             std::vector<bool> instruments) const;
  /// The cycle as it is, by index into `names`; -1: dark.
  std::vector<int> CycleNow(const std::vector<std::string>& names) const;
  /// The marks are lit one after another.
  bool strobed() const { return !cycle_.empty(); }
  /// Cycles of the record for each that is looked at [-].
  double weight() const { return weight_; }
  /// The fit that plans go by.
  const correlate::PlanBasis& basis() const { return basis_; }

 private:
  const data::Study& study_;
  const DesignOptions& options_;
  const StudyFit& fit_;
  std::size_t trial_;
  correlate::PlanBasis basis_;
  std::vector<double> growth_;      // by parameter [-]
  std::vector<std::string> cycle_;  // by slot; empty: dark
  double line_ = 0.0, first_ = 0.0;
  mutable double weight_ = 1.0;
  std::vector<std::unique_ptr<SceneModel>> models_;
};

/// Everything that could be in a trial of the study's own scene, and what of it is there now.
struct Stock {
  std::vector<std::string> marks;  ///< those at hand, then candidates
  std::size_t marks_at_hand = 0;
  correlate::PlannedContent content;
  std::size_t instruments_at_hand = 0;
  std::vector<std::string> instruments;    ///< names of candidates
  std::vector<std::size_t> instrument_at;  ///< of candidates, in the content's order
  std::vector<bool> now;                   ///< which of the content's instruments are there

  /// Those, and a candidate.
  std::vector<bool> With(std::size_t candidate) const {
    std::vector<bool> out = now;
    out[instrument_at[candidate]] = true;
    return out;
  }
};

/// All of it; without `candidates` what is there now. Throws Error, placed at a candidate.
Stock StockOf(const DesignOptions& options, const Planner& planner,
              const std::vector<data::Quantity>* quantities, bool candidates);

}  // namespace unfurl::study
