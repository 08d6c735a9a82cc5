#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace unfurl::sim {

class Certificate;
struct SimulateReport;

// What a certificate states of a run, of motions and of peak loads: the text for a terminal, and
// "certificate" in the JSON.
std::string CertificateText(const Certificate& certificate, const SimulateReport& report,
                            nlohmann::ordered_json* json);

}  // namespace unfurl::sim
