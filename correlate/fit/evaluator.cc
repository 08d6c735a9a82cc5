#include "correlate/fit/evaluator.h"

namespace unfurl::correlate {

Fidelity FidelityOfRung(std::size_t rung) {
  if (rung == 0) return Fidelity::kMain;
  return static_cast<Fidelity>(static_cast<std::int32_t>(Fidelity::kRung) +
                               static_cast<std::int32_t>(rung) - 1);
}

Fidelity FidelityOfRival(const FitTrial& trial, std::size_t i) {
  return FidelityOfRung(trial.rungs.size() + 1 + i);
}

const Model* ModelOf(const FitTrial& trial, Fidelity fidelity) {
  if (fidelity >= Fidelity::kRung) {
    const auto rung =
        static_cast<std::size_t>(fidelity) - static_cast<std::size_t>(Fidelity::kRung);
    const std::size_t rungs = trial.rungs.size();
    return rung < rungs ? trial.rungs[rung].model : trial.rivals.at(rung - rungs).model;
  }
  switch (fidelity) {
    case Fidelity::kTighter:
      return trial.tighter;
    case Fidelity::kFiner:
      return trial.finer;
    default:
      break;
  }
  return trial.model;
}

void Evaluator::SetStamps(std::vector<Stamps> stamps, int stage) {
  stamps_ = std::move(stamps);
  stage_ = stage;
  cache_.clear();
  age_.clear();
}

std::vector<Evaluator::Answer> Evaluator::Ask(const std::vector<const Request*>& requests,
                                              const std::vector<const Stamps*>& stamps) {
  std::vector<Job> jobs;
  for (std::size_t i = 0; i < requests.size(); ++i) {
    const Request& r = *requests[i];
    const Fidelity fidelity = Meant(r);
    jobs.push_back(
        {r.trial, fidelity, ModelOf(problem_.trials[r.trial], fidelity), r.theta, stamps[i]});
  }
  std::vector<Answer> answers(requests.size());
  workers_.Run(jobs, [&](std::size_t i, Prediction answer) {
    answers[i] = std::make_shared<const Prediction>(std::move(answer));
  });
  for (std::size_t i = 0; i < requests.size(); ++i) {
    EvaluationRecord record;
    record.theta = requests[i]->theta;
    record.purpose = requests[i]->purpose;
    record.stage = stage_;
    record.start = start_;
    record.trial = static_cast<int>(requests[i]->trial);
    record.fidelity = Meant(*requests[i]);
    record.status = answers[i]->status;
    record.message = answers[i]->message;
    records_.push_back(std::move(record));
  }
  if (on_batch && !requests.empty()) on_batch();
  return answers;
}

std::vector<Evaluator::Answer> Evaluator::EvaluateAt(const std::vector<Request>& requests,
                                                     const std::vector<Stamps>& stamps) {
  std::vector<const Request*> which;
  std::vector<const Stamps*> where;
  for (std::size_t i = 0; i < requests.size(); ++i) {
    which.push_back(&requests[i]);
    where.push_back(&stamps[i]);
  }
  return Ask(which, where);
}

std::vector<Evaluator::Answer> Evaluator::Evaluate(const std::vector<Request>& requests) {
  std::vector<const Request*> fresh;
  std::vector<const Stamps*> where;
  std::map<Key, Answer> mine;  // what this call needs, whatever the cache drops meanwhile
  for (const Request& request : requests) {
    const Key key{{request.trial, Meant(request)}, request.theta};
    const auto cached = cache_.find(key);
    if (cached != cache_.end()) {
      mine[key] = cached->second;
    } else if (mine.emplace(key, nullptr).second) {
      fresh.push_back(&request);
      where.push_back(&stamps_[request.trial]);
    }
  }
  const std::vector<Answer> answers = Ask(fresh, where);
  for (std::size_t i = 0; i < fresh.size(); ++i) {
    const Key key{{fresh[i]->trial, Meant(*fresh[i])}, fresh[i]->theta};
    mine[key] = cache_[key] = answers[i];
    age_.push_back(key);
  }
  while (age_.size() > kCached) {
    cache_.erase(age_.front());
    age_.pop_front();
  }
  std::vector<Answer> out;
  for (const Request& request : requests) {
    Answer answer = mine.at(Key{{request.trial, Meant(request)}, request.theta});
    const bool model =
        request.fidelity == Fidelity::kMain || request.fidelity == Fidelity::kTighter;
    if (correction_ != nullptr && request.corrected && model &&
        answer->status == ModelStatus::kGood) {
      answer = std::make_shared<const Prediction>(
          correction_->Apply(request.trial, request.theta, *answer));
    }
    out.push_back(std::move(answer));
  }
  return out;
}

void Evaluator::NoteCost(const std::vector<double>& theta, double cost) {
  std::size_t left = problem_.trials.size();
  for (auto record = records_.rbegin(); record != records_.rend() && left > 0; ++record) {
    if (record->stage != stage_) return;
    if (record->theta != theta || record->fidelity != FidelityOfRung(base_)) continue;
    if (record->cost < 0.0) record->cost = cost;
    --left;
  }
}

}  // namespace unfurl::correlate
