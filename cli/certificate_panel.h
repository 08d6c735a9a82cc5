#pragma once

#include <string>

#include "cli/run_columns.h"
#include "report/page.h"
#include "sim/record/run_summary.h"

namespace unfurl::cli {

// The largest errors that the certificate of a run states, in a sentence; empty where it has none.
// `input.certificate` is there, as below.
std::string CertificateSentence(const sim::SummaryInput& input);

// What a certificate states: tables of all, and the worst of the quantities with its band.
void AddCertificate(const sim::SummaryInput& input, const RunColumns& run, report::Page* page);

}  // namespace unfurl::cli
