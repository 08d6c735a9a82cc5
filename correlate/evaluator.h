#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "correlate/model.h"

namespace unfurl::correlate {

// Every call of the model that a fit made, in an order that does not depend on the workers.
struct EvaluationRecord {
  std::vector<double> theta;
  std::string purpose;  // "alignment", "trial", "difference", "finer model", ...
  int stage = 0;
  ModelStatus status = ModelStatus::kGood;
  std::string message;
  double cost = -1.0;  // half the sum of squares; -1: it was not compared with the data
  double seconds = 0.0;
  bool finer = false;
};

// Calls models for batches of parameters, several at once, and never twice for the same question.
// This is the seam behind which evaluations could be sent elsewhere than to local threads.
class Evaluator {
 public:
  struct Request {
    const Model* model = nullptr;
    std::vector<double> theta;
    std::string purpose;
    bool finer = false;
  };
  using Answer = std::shared_ptr<const Prediction>;

  explicit Evaluator(std::size_t workers) : workers_(workers) {}

  // New stamps: what was cached for others is dropped.
  void SetStamps(Stamps stamps, int stage);
  const Stamps& stamps() const { return stamps_; }

  // One answer per request, in their order. A model that throws anything but Interrupted is a
  // failed evaluation with the exception's text.
  std::vector<Answer> Evaluate(const std::vector<Request>& requests);
  Answer Evaluate(const Request& request);

  // Adds what an evaluation cost the data; the latest record of `theta` takes it.
  void NoteCost(const std::vector<double>& theta, double cost);
  void Note(EvaluationRecord record) { records_.push_back(std::move(record)); }

  const std::vector<EvaluationRecord>& records() const { return records_; }
  std::size_t count() const { return records_.size(); }
  std::function<void()> on_batch;  // after each batch: progress

 private:
  using Key = std::pair<const Model*, std::vector<double>>;
  std::size_t workers_;
  Stamps stamps_;
  int stage_ = 0;
  std::map<Key, Answer> cache_;
  std::vector<EvaluationRecord> records_;
};

}  // namespace unfurl::correlate
