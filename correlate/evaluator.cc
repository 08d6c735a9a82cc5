#include "correlate/evaluator.h"

#include <fmt/format.h>

#include <exception>

#include "base/error.h"
#include "base/progress.h"
#include "base/worker_pool.h"

namespace unfurl::correlate {

namespace {

// A model's answer is used only when it is whole: what is missing or not finite is a failure here
// and not a NaN somewhere later.
void CheckWhole(const Stamps& stamps, Prediction* p) {
  if (p->status != ModelStatus::kGood) return;
  auto fail = [&](const std::string& why) {
    p->status = ModelStatus::kFailed;
    p->message = why;
  };
  if (p->marks.size() != stamps.marks.size()) return fail("the model did not answer for all marks");
  for (std::size_t m = 0; m < p->marks.size(); ++m) {
    const MarkMotion& motion = p->marks[m];
    const auto n = static_cast<Eigen::Index>(stamps.t[m].size());
    if (motion.p.cols() != n || motion.v.cols() != n) {
      return fail("the model did not answer at all stamps of " + stamps.marks[m]);
    }
    if (!motion.p.allFinite() || !motion.v.allFinite()) {
      return fail("the model's motion of " + stamps.marks[m] + " is not finite");
    }
    for (std::uint8_t known : motion.known) {
      if (!known) return fail("the model's motion of " + stamps.marks[m] + " ends too early");
    }
  }
}

}  // namespace

void Evaluator::SetStamps(Stamps stamps, int stage) {
  stamps_ = std::move(stamps);
  stage_ = stage;
  cache_.clear();
}

Evaluator::Answer Evaluator::Evaluate(const Request& request) {
  return Evaluate(std::vector<Request>{request}).front();
}

std::vector<Evaluator::Answer> Evaluator::Evaluate(const std::vector<Request>& requests) {
  std::vector<const Request*> fresh;
  for (const Request& request : requests) {
    const Key key{request.model, request.theta};
    if (cache_.emplace(key, nullptr).second) fresh.push_back(&request);
  }
  std::vector<std::shared_ptr<Prediction>> answers(fresh.size());
  try {
    ParallelFor(fresh.size(), workers_, [&](std::size_t i) {
      ThrowIfInterrupted();
      auto answer = std::make_shared<Prediction>();
      try {
        *answer = fresh[i]->model->Evaluate(fresh[i]->theta, stamps_);
        CheckWhole(stamps_, answer.get());
      } catch (const Interrupted&) {
        throw;
      } catch (const std::exception& e) {
        answer->status = ModelStatus::kFailed;
        answer->message = e.what();
      }
      answers[i] = std::move(answer);
    });
  } catch (...) {
    for (const Request* request : fresh) cache_.erase(Key{request->model, request->theta});
    throw;
  }
  for (std::size_t i = 0; i < fresh.size(); ++i) {
    EvaluationRecord record;
    record.theta = fresh[i]->theta;
    record.purpose = fresh[i]->purpose;
    record.stage = stage_;
    record.status = answers[i]->status;
    record.message = answers[i]->message;
    record.seconds = answers[i]->seconds;
    record.finer = fresh[i]->finer;
    records_.push_back(std::move(record));
    cache_[Key{fresh[i]->model, fresh[i]->theta}] = std::move(answers[i]);
  }
  std::vector<Answer> out;
  for (const Request& request : requests)
    out.push_back(cache_.at(Key{request.model, request.theta}));
  if (on_batch && !fresh.empty()) on_batch();
  return out;
}

void Evaluator::NoteCost(const std::vector<double>& theta, double cost) {
  for (auto record = records_.rbegin(); record != records_.rend(); ++record) {
    if (record->theta == theta && !record->finer && record->stage == stage_) {
      if (record->cost < 0.0) record->cost = cost;
      return;
    }
  }
}

}  // namespace unfurl::correlate
