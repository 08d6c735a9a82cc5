#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "data/live_stream.h"

namespace unfurl::data {

// The first line of a stream. Throws Error for what is missing, unknown or impossible.
LiveHeader ParseLiveHeader(const nlohmann::json& header, const std::string& where);
std::string LiveHeaderText(const LiveHeader& header);

}  // namespace unfurl::data
