#pragma once

#include <string>

#include "study/design.h"

namespace unfurl::study {

/// What a plan, together with what is there, makes of the standard errors of the wanted parameters:
/// the geometric mean over today's [-]; infinity where it does not run.
double FactorOf(const StudyDesign& design, const DesignCase& plan);

/// What the figures of a design come to, in one sentence: what to measure next and what the
/// standard errors of the wanted parameters become by it, or that the model comes first, whose own
/// error is larger than the data's of every wanted parameter. Empty where nothing was weighed.
std::string Advice(const StudyDesign& design);

}  // namespace unfurl::study
