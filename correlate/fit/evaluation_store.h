#pragma once

#include <functional>
#include <map>
#include <mutex>
#include <string>

#include "correlate/fit/workers.h"
#include "data/journal.h"

namespace unfurl::correlate {

// Workers that remember: every answer goes to a journal as it comes, and a question that the
// journal knows already is answered from there, to the last bit. A fit is a function of its
// inputs and of these answers alone, so a fit that was killed and is run again with the same
// journal ends in the same bits as one that was not, whatever the moment and the number of workers.
// Failed evaluations are answers, too.
class JournaledWorkers : public Workers {
 public:
  // Both must outlive it. Throws Error for a journal whose records are not evaluations.
  JournaledWorkers(Workers& inner, data::Journal& journal);
  void Run(std::span<const Job> jobs,
           const std::function<void(std::size_t, Prediction)>& done) override;

  std::size_t answered() const { return answered_; }  // from the journal, so far

 private:
  Workers& inner_;
  data::Journal& journal_;
  mutable std::mutex mutex_;
  std::map<std::string, std::size_t> index_;  // question's bytes -> record
  std::size_t answered_ = 0;
};

// A question and its answer as bytes, and back; the question's part is `key_bytes` long.
std::string QuestionBytes(const Job& job);
std::string AnswerBytes(const Prediction& prediction);
bool ParseAnswer(std::string_view bytes, Prediction* prediction);  // false: not an answer

/// A question that stands for itself: with its stamps, for another process.
struct StoredQuestion {
  std::size_t trial = 0;                ///< of its problem
  Fidelity fidelity = Fidelity::kMain;  ///< which of the trial's models
  std::vector<double> theta;            ///< [units of the parameters]
  Stamps stamps;                        ///< at which it is asked
};
/// As bytes, and back; false: not a question.
std::string WholeQuestionBytes(const Job& job);
bool ParseQuestion(std::string_view bytes, StoredQuestion* question);

}  // namespace unfurl::correlate
