#include "campaign/responses.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace unfurl::campaign {

using data::CampaignResponse;

DerivedResponses::DerivedResponses(const data::Campaign& plan) : responses_(plan.responses) {
  std::vector<std::string> names;
  for (const data::CampaignVariable& v : plan.variables) names.push_back(v.name);
  for (const CampaignResponse& r : responses_) {
    if (r.source == CampaignResponse::Source::kExpression) {
      expressions_.emplace_back(r.expression, names, r.where + ".expression");
    }
    names.push_back(r.name);
  }
  known_.resize(names.size());
}

void DerivedResponses::Finish(std::span<const double> values, std::span<double> responses) {
  std::copy(values.begin(), values.end(), known_.begin());
  const std::span<double> own = std::span(known_).subspan(values.size());
  std::size_t next = 0;
  for (std::size_t k = 0; k < responses_.size(); ++k) {
    if (responses_[k].source == CampaignResponse::Source::kExpression) {
      // muParser's comparisons take NaN for a number: an expression of what is not there is not
      // there.
      const NamedExpression& expression = expressions_[next++];
      const bool whole = std::none_of(expression.used().begin(), expression.used().end(),
                                      [&](std::size_t i) { return std::isnan(known_[i]); });
      own[k] = whole ? expression.Value(std::span(known_).first(values.size() + k))
                     : std::numeric_limits<double>::quiet_NaN();
    } else {
      own[k] = responses[k];
    }
  }
  for (std::size_t k = 0; k < responses_.size(); ++k) {
    const CampaignResponse& r = responses_[k];
    responses[k] = own[k];
    if ((!r.above && !r.below) || std::isnan(own[k])) continue;
    const bool yes = (!r.above || own[k] > *r.above) && (!r.below || own[k] < *r.below);
    responses[k] = yes ? 1.0 : 0.0;
  }
}

}  // namespace unfurl::campaign
