#pragma once

#include <span>
#include <string>
#include <vector>

#include "campaign/named_expression.h"
#include "data/campaign.h"

namespace unfurl::campaign {

/// Responses that follow from others, and thresholds: what a job of any kind has in common.
class DerivedResponses {
 public:
  /// Throws Error (file:line:key) for an expression with names that are not before it.
  explicit DerivedResponses(const data::Campaign& plan);

  /// `responses` holds the numbers of those that the job itself gives; fills in the rest, and turns
  /// those with a threshold into 1 and 0. An expression sees the numbers, not the 1 and 0.
  void Finish(std::span<const double> values, std::span<double> responses);

 private:
  const std::vector<data::CampaignResponse> responses_;
  std::vector<NamedExpression> expressions_;  // in order
  std::vector<double> known_;                 // variables, then responses
};

}  // namespace unfurl::campaign
