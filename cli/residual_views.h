#pragma once

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "report/page.h"

namespace unfurl::cli {

// Residuals of a mark or a camera, in standard deviations, in the order in which neighbours may be
// alike: of time, or along a sensor.
struct ResidualGroup {
  std::string name;
  std::vector<double> along;  // rising [the unit of ResidualViews::along]
  std::vector<double> value;  // as many [-]
};

// Divides the values by their RMS; false, and nothing done, where all are zero or none is there.
bool DivideByRms(ResidualGroup* group);

// Residuals as people judge them.
struct ResidualViews {
  std::string of;     // "mark", "camera": what a group is
  std::string words;  // in which standard deviations
  report::Axis along;
  bool scatter = true;     // the chart over `along`; false: the page has one
  bool own_scale = false;  // they were divided by their own RMS: the table leaves it out
  bool neighbours = true;  // the autocorrelation chart; false: the page has one
  // How many of all groups' residuals are independent, where groups share what one number shows
  // (cameras at one point: their degrees of freedom); 0: all. Within a group they are.
  double independent = 0.0;
  std::vector<ResidualGroup> groups;
};

// Over time (or the sensor), against a normal distribution, the likeness of neighbours, and a table
// by group. Nothing where there are fewer than eight residuals.
void AddResidualViews(const ResidualViews& views, report::Page* page);

// Between which two values the kth smallest (from 1) of n values that are standard normal and
// independent lies with probability `share`, as much below as above.
std::pair<double, double> NormalOrderBand(std::size_t k, std::size_t n, double share);

// Of values in order, at lag 0 to `lags`; their mean is left in [-].
std::vector<double> Autocorrelations(const std::vector<double>& value, std::size_t lags);

}  // namespace unfurl::cli
