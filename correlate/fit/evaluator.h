#pragma once

#include <cstddef>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "correlate/fit/correction.h"
#include "correlate/fit/fit_problem.h"
#include "correlate/fit/workers.h"

namespace unfurl::correlate {

// Every call of a model that a fit made, in an order that does not depend on the workers.
struct EvaluationRecord {
  std::vector<double> theta;  // [units of the parameters]
  std::string purpose;        // "alignment", "trial", "difference", "finer model", "profile", ...
  int stage = 0;
  int start = -1;  // which of several starts; -1: not of one
  int trial = 0;
  Fidelity fidelity = Fidelity::kMain;
  ModelStatus status = ModelStatus::kGood;
  std::string message;
  double cost = -1.0;  // half the sum of squares; -1: it was not compared with the data [-]
};

// Asks models for batches of parameters, never twice for the same question within a stage, and
// keeps the record. What carries the questions out is the Workers.
class Evaluator {
 public:
  // One question: a trial's model at some parameters.
  struct Request {
    std::size_t trial = 0;
    std::vector<double> theta;  // [units of the parameters]
    std::string purpose;
    Fidelity fidelity = Fidelity::kMain;
    bool corrected = true;  // kMain, kTighter: with the correction that stands
  };
  // What a model said; several askers share it.
  using Answer = std::shared_ptr<const Prediction>;

  Evaluator(const FitProblem& problem, Workers& workers, int start = -1)
      : problem_(problem), workers_(workers), start_(start) {}

  // New stamps for each trial: what was cached for others is dropped.
  void SetStamps(std::vector<Stamps> stamps, int stage);

  // One answer per request, in their order; a failure is an answer.
  std::vector<Answer> Evaluate(const std::vector<Request>& requests);
  // At stamps of its own, one set per request; not cached.
  std::vector<Answer> EvaluateAt(const std::vector<Request>& requests,
                                 const std::vector<Stamps>& stamps);

  // The rung that kMain means from now on; 0: the trials' `model`.
  void SetBase(std::size_t rung) { base_ = rung; }
  // Added to every answer of kMain and kTighter at the standing stamps; null: none.
  void SetCorrection(std::shared_ptr<const Correction> correction) {
    correction_ = std::move(correction);
  }

  // Adds what an evaluation cost the data; the latest records of `theta` take it.
  void NoteCost(const std::vector<double>& theta, double cost);

  const FitProblem& problem() const { return problem_; }                     // as given
  const std::vector<EvaluationRecord>& records() const { return records_; }  // in order
  std::function<void()> on_batch;  // after each batch: progress

 private:
  using Key = std::pair<std::pair<std::size_t, Fidelity>, std::vector<double>>;
  static constexpr std::size_t kCached = 200;  // answers; a long record takes 200 kB each
  // Rung 0 itself is asked for uncorrected.
  Fidelity Meant(const Request& request) const {
    return request.corrected && request.fidelity == Fidelity::kMain ? FidelityOfRung(base_)
                                                                    : request.fidelity;
  }
  std::vector<Answer> Ask(const std::vector<const Request*>& requests,
                          const std::vector<const Stamps*>& stamps);

  const FitProblem& problem_;
  Workers& workers_;
  int start_;
  std::vector<Stamps> stamps_;
  int stage_ = 0;
  std::size_t base_ = 0;
  std::shared_ptr<const Correction> correction_;
  std::map<Key, Answer> cache_;
  std::deque<Key> age_;
  std::vector<EvaluationRecord> records_;
};

}  // namespace unfurl::correlate
