// Overrides of a trial that a parameter would undo.
#include "study/driven_keys.h"

#include <gtest/gtest.h>

#include "base/error.h"

namespace unfurl::study::driven_keys_test {
namespace {

TEST(DrivenKeys, AnOverrideThatAParameterWouldUndoIsRefused) {
  std::vector<data::StudyParameter> parameters(2);
  parameters[0].name = "damping", parameters[0].keys = {"joint.hinge.damper.damping"};
  parameters[1].name = "start", parameters[1].keys = {"joint.a.theta", "joint.b.theta"};
  EXPECT_NO_THROW(RefuseDrivenKeys({"joint.b.theta_rate=1", "body.arm.mass=2"}, parameters, "at"));
  for (const char* set : {"joint.b.theta=1.2", "joint.b.theta = 1.2"}) {
    try {
      RefuseDrivenKeys({"body.arm.mass=2", set}, parameters, "study.toml:7:trial.high");
      FAIL() << set;
    } catch (const Error& e) {
      EXPECT_EQ(e.where(), "study.toml:7:trial.high");
      EXPECT_NE(e.problem().find("start"), std::string::npos);
    }
  }
}

}  // namespace
}  // namespace unfurl::study::driven_keys_test
