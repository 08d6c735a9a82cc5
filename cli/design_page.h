#pragma once

#include <string>
#include <vector>

#include "data/provenance.h"
#include "study/design.h"

namespace unfurl::cli {

/// Tables of a design, the header first: what tells of each parameter, and what could be done next.
using TextTable = std::vector<std::vector<std::string>>;
TextTable ContributionRows(const std::vector<correlate::Contribution>& parts,
                           const std::vector<std::string>& parameters, const std::string& head);
TextTable PlanRows(const study::StudyDesign& design, const std::vector<study::DesignCase>& cases,
                   const std::string& head);

/// "mark1 mark1 mark2 dark".
std::string CycleText(const std::vector<std::string>& cycle);

void WriteDesignPage(const std::string& path, const std::string& study,
                     const study::StudyDesign& design, const data::Provenance& provenance);

}  // namespace unfurl::cli
