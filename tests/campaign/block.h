#pragma once

#include <string>

#include "data/campaign.h"
#include "tests/own_folder.h"

namespace unfurl::campaign {

// A block that slides at the speed v: it is at v t, and passes 1 m at 1 / v, all in closed form.
inline constexpr char kBlock[] =
    "[scene]\nname = \"block\"\nduration = 2.0\n"
    "[body.block]\nmass = 2.0\ninertia = 0.1\nvelocity = [0.7, 0, 0]\n"
    "[event.passes]\nwhen = \"block.x\"\nlevel = 1.0\n";

// A plan over it, with the responses that are given.
inline data::Campaign BlockPlan(const OwnFolder& folder, const std::string& responses,
                                const std::string& campaign = "runs = 40\n",
                                const std::string& variable = "uniform = [0.25, 1.0]\n") {
  folder.Put("block.toml", kBlock);
  folder.Put("plan.toml", "[campaign]\n" + campaign +
                              "[job]\nscene = \"block.toml\"\nrate = 100\n"
                              "[variable.v]\nkeys = [\"body.block.velocity[0]\"]\n" +
                              variable + responses);
  return data::ReadCampaign(folder.File("plan.toml"));
}

}  // namespace unfurl::campaign
