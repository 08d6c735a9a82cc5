#pragma once

#include <string>
#include <vector>

#include "correlate/align/align.h"
#include "correlate/fit/gross_samples.h"

namespace unfurl::correlate {

/// Aligns channels with a reference, single gross readings put aside by what they leave, as a fit
/// does (FindChannelGross): first without those that lie off their neighbours by more than the
/// motion, then without those that the residuals show. `observations` is left without them.
Alignment AlignWithoutGross(const SampledModel& reference, Observations* observations,
                            std::vector<ChannelGross>* gross);

/// The readings put aside, a sentence for each channel; `of`: " of trial 2".
std::vector<std::string> GrossWords(const Observations& observations,
                                    const std::vector<ChannelGross>& gross,
                                    const std::string& of = {});

/// One channel of which nothing else is known; `sigma` may be empty.
struct Readings {
  std::vector<double>* t = nullptr;      ///< [s]
  std::vector<double>* y = nullptr;      ///< [unit]
  std::vector<double>* sigma = nullptr;  ///< [unit]
};
/// Takes out of it where the instrument dropped out (FindHeldRuns) and what lies off its neighbours
/// by more than the motion (FindFarReadings); what that was, in sentences.
std::vector<std::string> TakeOutWrong(const std::string& name, const std::string& unit,
                                      const Readings& readings);

}  // namespace unfurl::correlate
