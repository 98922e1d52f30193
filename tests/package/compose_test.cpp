#include <gtest/gtest.h>

#include <chrono>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/support/process.h"
#include "tests/support/temporary_folder.h"

// deploy/compose.yaml names what deploy/image makes. That the image serves, deploy/image tries
// itself.
namespace trammel {
namespace {

using nlohmann::json;

constexpr std::chrono::seconds kLimit{60};

class Compose : public testing::Test {
 protected:
  void SetUp() override {
    const test::Finished read =
        test::run({"/usr/bin/env", "python3", "-c",
                   "import json, sys, yaml; print(json.dumps(yaml.safe_load(open(sys.argv[1]))))",
                   TRAMMEL_SOURCE_DIR "/deploy/compose.yaml"},
                  kLimit);
    if (read.err.find("No module named 'yaml'") != std::string::npos)
      GTEST_SKIP() << "no python3-yaml here";
    ASSERT_EQ(read.exit_code, 0) << read.err;
    file_ = json::parse(read.out);
    service_ = file_.at("services").at("trammeld");
  }
  static bool image_has(const std::string& text) {
    return test::read_file(TRAMMEL_SOURCE_DIR "/deploy/image").find(text) != std::string::npos;
  }

  json file_, service_;
};

TEST_F(Compose, NamesTheImageThatIsMade) {
  const std::string image = service_.at("image");
  const std::string host = "localhost/";
  ASSERT_TRUE(image.starts_with(host)) << image << " would be asked of a registry";
  EXPECT_TRUE(image_has("oci-archive:$archive:" + image.substr(host.size()) + "\"")) << image;
}

TEST_F(Compose, MountsTheImagesStoreAndItsServerFile) {
  std::vector<std::string> places;
  for (const std::string volume : service_.at("volumes")) {
    const std::size_t from = volume.find(':') + 1;
    const std::string place = volume.substr(from, volume.find(':', from) - from);
    if (volume.starts_with("/")) {
      EXPECT_TRUE(volume.ends_with(":ro")) << volume;
      EXPECT_TRUE(image_has("\"" + place + "/server.yaml\"")) << place;
    } else {
      EXPECT_TRUE(file_.at("volumes").contains(volume.substr(0, from - 1))) << volume;
      EXPECT_TRUE(image_has("--volume " + place + " ")) << place;
    }
  }
  EXPECT_EQ(service_.at("volumes").size(), 2U);
}

TEST_F(Compose, IsAsShutInAsTheImageIsTried) {
  EXPECT_EQ(service_.at("network_mode"), "host");
  EXPECT_EQ(service_.at("read_only"), true);
  EXPECT_EQ(service_.at("cap_drop"), json::array({"ALL"}));
  EXPECT_EQ(service_.at("security_opt"), json::array({"no-new-privileges"}));
  EXPECT_EQ(service_.at("tmpfs"), json::array({"/tmp"}));
}

TEST_F(Compose, AsksForHealthAsTheCommandLineUnderstandsIt) {
  std::vector<std::string> asked = service_.at("healthcheck").at("test");
  ASSERT_GT(asked.size(), 2U);
  EXPECT_EQ(asked[0], "CMD");
  EXPECT_EQ(asked[1], "trammel");
  asked.erase(asked.begin());
  asked[0] = TRAMMEL_BINARY_DIR "/clients/trammel";
  asked.insert(asked.end(), {"--port", "17597", "--domain", "93"});
  const test::Finished said = test::run(asked, kLimit);
  EXPECT_EQ(said.exit_code, 4) << "nobody answers there, and nothing is wrong with the words: "
                               << said.err;
}

}  // namespace
}  // namespace trammel
