// The command line on machines other than this one: older processors, another library of linear
// algebra.
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/support/process.h"
#include "tests/support/temporary_folder.h"

namespace trammel {
namespace {

class Processors : public testing::Test {
 protected:
  /// The trammel program where the environment says `setting`.
  static test::Finished run(const std::string& setting, std::vector<std::string> words) {
    words.insert(words.begin(), {"/usr/bin/env", setting, kProgram});
    test::Finished finished = test::run(words, std::chrono::minutes(2));
    EXPECT_EQ(finished.exit_code, 0) << finished.err;
    return finished;
  }
  void measure() {
    run("TRAMMEL_NUMERICS=",
        {"plan", "--cell", kCell, "--count", "100", "-o", folder_.file("plan.csv")});
    run("TRAMMEL_NUMERICS=", {"simulate", "--cell", kCell, "--truth", kTruth, "--plan",
                              folder_.file("plan.csv"), "-o", batch_});
  }
  /// The error that the model leaves that is trained there.
  [[nodiscard]] double left_mm(const std::string& setting) const {
    run(setting, {"train", "--cell", kCell, "--batch", batch_, "--level", "M2", "--bias", "se",
                  "-o", model_});
    return evaluated_mm(setting);
  }
  [[nodiscard]] double evaluated_mm(const std::string& setting) const {
    const auto printed =
        run(setting, {"evaluate", "--model", model_, "--batch", batch_, "--json", "-"}).out;
    return nlohmann::json::parse(printed).at("rms_mm").get<double>();
  }

  static constexpr const char* kProgram = TRAMMEL_BINARY_DIR "/clients/trammel";
  static constexpr const char* kCell = TRAMMEL_SOURCE_DIR "/config/cell-7.yaml";
  static constexpr const char* kTruth = TRAMMEL_SOURCE_DIR "/models/truth/chapter-5.yaml";
  test::TemporaryFolder folder_;
  const std::string batch_ = folder_.file("batch.csv"), model_ = folder_.file("cell.model");
};

TEST_F(Processors, EachTrainsAModelThatIsAsGood) {
  measure();
  const double baseline_mm = left_mm("TRAMMEL_NUMERICS=baseline");
  EXPECT_GT(baseline_mm, 0);
  EXPECT_NEAR(left_mm("TRAMMEL_NUMERICS=avx2"), baseline_mm, 1e-4);
  EXPECT_NEAR(left_mm("TRAMMEL_NUMERICS=avx512"), baseline_mm, 1e-4);
}

TEST_F(Processors, WithAnotherLibraryOfLinearAlgebraTheModelIsAsGoodAndBothReadIt) {
  const std::string libraries = "/usr/lib/x86_64-linux-gnu/",
                    of_netlib = libraries + "blas:" + libraries + "lapack",
                    openblas = libraries + "openblas-pthread";
  for (const std::string& file : {libraries + "blas/libblas.so.3", openblas + "/libblas.so.3"})
    ASSERT_TRUE(std::filesystem::exists(file)) << file << ": deploy/dependencies installs it";
  measure();
  const double there_mm = left_mm("LD_LIBRARY_PATH=" + of_netlib);
  EXPECT_NEAR(left_mm("LD_LIBRARY_PATH=" + openblas), there_mm, 1e-4);
  EXPECT_NEAR(evaluated_mm("LD_LIBRARY_PATH=" + of_netlib), there_mm, 1e-4)
      << "the other one's model";
}

}  // namespace
}  // namespace trammel
