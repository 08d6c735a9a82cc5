#pragma once

#include "data/csv.h"
#include "data/survey.h"

namespace unfurl::data {

// Column `set_up` of a table of points, where it has one, into survey->set_up. Throws Error with
// file:line:set_up for an empty cell, and for what one station's place is needed of while points
// were measured from several: angles and distances, a prism's offset.
void ReadSetUps(const CsvTable& table, Survey* survey);

}  // namespace unfurl::data
