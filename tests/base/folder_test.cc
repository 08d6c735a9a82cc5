#include "base/folder.h"

#include <gmock/gmock.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

namespace unfurl::folder_test {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::UnorderedElementsAre;

TEST(Folder, NamesAndPatterns) {
  const fs::path folder = fs::temp_directory_path() / ("unfurl_folder_" + std::to_string(getpid()));
  fs::create_directories(folder / "door_9.raw");
  for (const char* name : {"door_2.raw", "door_10.raw", "door.raw", ".hidden", "caf\xe9_1.raw"}) {
    std::ofstream(folder / name) << "x";
  }
  EXPECT_THAT(NamesIn(folder.string()),
              UnorderedElementsAre("door_2.raw", "door_10.raw", "door.raw", ".hidden",
                                   "caf\xe9_1.raw", "door_9.raw"));
  // A folder is no file, and one '*' does not stand for letters used twice.
  EXPECT_THAT(FilesLike((folder / "door_*.raw").string()),
              ElementsAre((folder / "door_10.raw").string(), (folder / "door_2.raw").string()));
  EXPECT_THAT(FilesLike((folder / "caf*.raw").string()),
              ElementsAre((folder / "caf\xe9_1.raw").string()));
  EXPECT_THAT(FilesLike((folder / "door.raw*.raw").string()), IsEmpty());
  EXPECT_THAT(NamesIn((folder / "nowhere").string()), IsEmpty());
  EXPECT_THAT(NamesIn((folder / "door.raw").string()), IsEmpty());
  fs::remove_all(folder);
}

}  // namespace
}  // namespace unfurl::folder_test
