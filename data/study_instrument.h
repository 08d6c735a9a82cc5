#pragma once

#include "data/study.h"
#include "data/toml.h"

namespace unfurl::data {

// "free", "known" (it is 0), a number (that it is known to be), { mean = .., sigma = .. }.
StudyKnowledge ReadKnowledge(const TomlTable& t, const char* key, TomlRange range);

// What an instrument measures and what is known of it: quantity, unit, sigma, gain, bias, delay,
// drift, filter.
void ReadInstrument(const TomlTable& t, StudyChannel* c);

// Which event a switch sees: event, joint or watch, edge, delay.
void ReadSwitch(const TomlTable& t, StudyChannel* c);

}  // namespace unfurl::data
