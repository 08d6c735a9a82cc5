#pragma once

#include <cstddef>
#include <vector>

#include "measure/health.h"
#include "measure/reading_course.h"

namespace unfurl::measure {

// A reading of a course.
struct CourseOutlier {
  std::size_t flash = 0, camera = 0;
};

// Readings that no other reading of their flash vouches for (three are there) and that depart by
// more than five sigmas from the course of those before and after them, which goes on without them
// as if nothing were: in no other camera anything departs, and no more than two in a row do. In the
// order of flashes. None of a course that `scatter` knows nothing of.
std::vector<CourseOutlier> OutliersOf(const ReadingCourse& course, const CourseScatter& scatter);

// By mark that is lit alone.
std::vector<ReadingCourse> CoursesOf(const HealthEvidence& evidence, std::size_t cameras);

// Of all marks.
std::vector<WrongReading> WrongIn(const std::vector<ReadingCourse>& readings,
                                  const std::vector<CourseScatter>& courses);

}  // namespace unfurl::measure
