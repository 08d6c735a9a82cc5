#pragma once

#include <string_view>

namespace unfurl::cli {

// The files of cli/starts, in the program itself.
extern const std::string_view kBoomReadme, kBoomScene;
extern const std::string_view kWingReadme, kWingScene;
extern const std::string_view kRigReadme, kRigLab, kRigPoints, kRigTemplate, kRigBar,
    kRigBarTemplate;
extern const std::string_view kTrialReadme, kTrialLines, kTrialStamps, kTrialDoor, kTrialWindow,
    kTrialBench;
extern const std::string_view kCampaignReadme, kCampaignPlan;
extern const std::string_view kStudyReadme, kStudyScene, kStudyStudy, kStudyTracks;

}  // namespace unfurl::cli
