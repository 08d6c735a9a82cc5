#pragma once

#include <atomic>

#include "base/error.h"
#include "correlate/fit/workers.h"

namespace unfurl::correlate {

// Hands out `left` answers and is interrupted then, as by Ctrl-C.
class Stopped : public Workers {
 public:
  Stopped(Workers& inner, int left) : inner_(inner), left_(left) {}
  void Run(std::span<const Job> jobs,
           const std::function<void(std::size_t, Prediction)>& done) override {
    for (std::size_t i = 0; i < jobs.size(); ++i) {
      if (left_.fetch_sub(1) <= 0) throw Interrupted();
      inner_.Run(jobs.subspan(i, 1),
                 [&](std::size_t, Prediction answer) { done(i, std::move(answer)); });
    }
  }

 private:
  Workers& inner_;
  std::atomic<int> left_;
};

}  // namespace unfurl::correlate
