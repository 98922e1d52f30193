#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <string>
#include <vector>

#include "tests/support/daemon.h"
#include "tests/support/process.h"
#include "tests/support/temporary_folder.h"

// Programs of others use this project in two ways; each way builds tests/package/consumer from
// nothing and runs it.

namespace trammel {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::minutes kPackageLimit{15};

void run_to_its_end(const std::vector<std::string>& command) {
  const test::Finished finished = test::run(command, kPackageLimit);
  EXPECT_EQ(finished.exit_code, 0) << command[0] << " " << command[1] << ":\n"
                                   << finished.out << finished.err;
}

/// The consumer, configured with `definitions` and built without optimisation in an empty folder.
class Consumer {
 public:
  Consumer(const std::string& name, const std::vector<std::string>& definitions,
           const std::string& part)
      : folder_(fs::path(TRAMMEL_BINARY_DIR) / "tests" / "package" / name) {
    fs::remove_all(folder_);
    std::vector<std::string> configure = {
        "/usr/bin/cmake",
        "-GNinja",
        "-S",
        std::string(TRAMMEL_SOURCE_DIR) + "/tests/package/consumer",
        "-B",
        folder_.string()};
    configure.insert(configure.end(), definitions.begin(), definitions.end());
    run_to_its_end(configure);
    run_to_its_end({"/usr/bin/cmake", "--build", folder_.string(), "--target", part});
    EXPECT_EQ(test::read_file((folder_ / (part + ".options")).string()), "")
        << "our flags are given to others";
  }
  [[nodiscard]] std::string program(const std::string& part) const {
    return (folder_ / part).string();
  }

 private:
  fs::path folder_;
};

/// Where this build was installed, in an empty folder.
std::string installed() {
  static const test::TemporaryFolder kPrefix;
  run_to_its_end(
      {"/usr/bin/cmake", "--install", TRAMMEL_BINARY_DIR, "--prefix", kPrefix.path().string()});
  return kPrefix.path().string();
}

void expect_to_reach_a_daemon(const Consumer& consumer) {
  test::Daemon daemon;
  daemon.start();
  const test::Finished asked = test::run(
      {consumer.program("session"), std::to_string(daemon.port()), std::to_string(daemon.domain())},
      kPackageLimit);
  EXPECT_EQ(asked.exit_code, 0) << asked.out << asked.err;
  EXPECT_EQ(asked.out, "cell-7\n");
}

TEST(Package, AnInstalledSessionIsFoundByItselfAndReachesADaemon) {
  expect_to_reach_a_daemon(
      Consumer("installed-session",
               {"-DCMAKE_PREFIX_PATH=" + installed(), "-DTRAMMEL_PARTS=session"}, "session"));
}

TEST(Package, AnInstalledOfflineLibraryReadsAModelOfTheInstalledProgram) {
  const std::string prefix = installed();
  const Consumer consumer("installed-offline",
                          {"-DCMAKE_PREFIX_PATH=" + prefix, "-DTRAMMEL_PARTS=offline"}, "offline");
  const test::TemporaryFolder folder;
  const std::string trammel = prefix + "/bin/trammel",
                    cell = prefix + "/share/trammel/config/cell-7.yaml";
  const std::string plan = folder.file("plan.csv"), batch = folder.file("batch.csv"),
                    model = folder.file("a.model");
  run_to_its_end({trammel, "plan", "--cell", cell, "--count", "60", "-o", plan});
  run_to_its_end({trammel, "simulate", "--cell", cell, "--truth",
                  prefix + "/share/trammel/models/truth/chapter-5.yaml", "--plan", plan, "-o",
                  batch});
  run_to_its_end(
      {trammel, "train", "--cell", cell, "--batch", batch, "--bias", "none", "-o", model});
  const test::Finished predicted = test::run({consumer.program("offline"), model}, kPackageLimit);
  EXPECT_EQ(predicted.exit_code, 0) << predicted.out << predicted.err;
  EXPECT_TRUE(predicted.out.ends_with(" mm\n")) << predicted.out;
}

TEST(Package, AsAFolderOfAnotherProjectTheSessionIsBuiltWithItAndReachesADaemon) {
  // A header that few sources read is not worth precompiling.
  expect_to_reach_a_daemon(Consumer("subdirectory",
                                    {std::string("-DTRAMMEL_SOURCE=") + TRAMMEL_SOURCE_DIR,
                                     "-DCMAKE_DISABLE_PRECOMPILE_HEADERS=ON"},
                                    "session"));
}

}  // namespace
}  // namespace trammel
