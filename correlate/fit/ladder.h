#pragma once

#include <memory>
#include <string>
#include <vector>

#include "correlate/fit/correction.h"
#include "correlate/fit/search.h"

namespace unfurl::correlate {

/// A fit of the finest rung at the price of a coarse one. The coarse rung is solved with the
/// difference (fine less coarse) of the present point added; where that leads, the difference is
/// taken anew, until the next step is small: at such a point the corrected model is the fine one
/// [Alexandrov and Lewis 2001; Bandler et al. 2004, "space mapping"; Peherstorfer, Willcox and
/// Gunzburger 2018, SIAM Rev. 60, 550-591]. It leaves the gradient of the coarse rung in the place
/// of the fine one's, which moves the fixed point by no more than their relative difference times a
/// standard error.
class Ladder {
 public:
  Ladder(const FitProblem& problem, const FitOptions& options);

  bool wanted() const { return top_ > 0; }
  /// From where the runner stands, over the whole record. False: a model failed there.
  bool Climb(StageRunner& runner, const std::vector<const Observations*>& data,
             const std::vector<const RowWhitening*>& whitening, const std::string& what);

  /// What a climb from where the runner stands begins with, to be asked for beside other things;
  /// none once it has begun.
  std::vector<Evaluator::Request> FirstRequests(const StageRunner& runner) const;

  const LadderResult& result() const { return result_; }
  std::size_t top() const { return top_; }
  /// Where rungs were compared last; null before a look, or where the finest was fitted itself.
  const Correction* correction() const { return correction_.get(); }
  /// Why the finest rung could not be evaluated at the first look; empty: it could.
  const std::string& failure() const { return failure_; }

 private:
  enum class Way { kOn, kSettled, kUp, kFineFailed, kModelFailed };
  using Answers = std::vector<Evaluator::Answer>;

  Way Rounds(StageRunner& runner, const std::vector<const Observations*>& data,
             const std::vector<const RowWhitening*>& whitening, const std::string& what);
  Way Advance(StageRunner& runner, double step, double contraction, int* unsuccessful);
  // `buy`: slopes, too, unless they are fresh: after a step of less than a standard error the end
  // is near, which stands on slopes of its own.
  bool Ask(StageRunner& runner, bool buy, Answers* coarse, Answers* fine);
  bool FirstLook(StageRunner& runner, const std::vector<const Observations*>& data, double step);
  bool Told(StageRunner& runner, const ReducedProblem::Point& before,
            const ReducedProblem::Point& here) const;
  bool EventsAgree(const Answers& coarse, const Answers& fine);
  LadderRound& AddRound(const StageRunner& runner);
  void Note(const std::string& words);
  Correction::Difference DifferenceOf(const Answers& coarse, const Answers& fine) const;

  const FitProblem& problem_;
  const FitOptions& options_;
  std::size_t top_ = 0;  // rung
  std::vector<const Observations*> data_;
  std::shared_ptr<Correction> correction_;
  Answers fine_;  // at the correction's centre
  std::string failure_;
  LadderResult result_;
};

/// The first difference in words between the latches of two predictions of one motion; empty: none.
/// Neighbours nearer in time than `resolution` [s] have no order.
std::string LatchesDiffer(const Prediction& coarse, const Prediction& fine, double resolution);

}  // namespace unfurl::correlate
