#include "server/http/tokens.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <fstream>

#include "tests/support/temporary_folder.h"

namespace trammel {
namespace {

// SHA-256 of `secret`, from `printf secret | sha256sum`.
const std::string kHash = "2bb80d537b1da3e38bd30361aa855686bde0eacd7162fef6a25fe97bf527a25b";

class TokensTest : public testing::Test {
 protected:
  Result<Tokens> read(const std::string& text, mode_t mode = 0600) {
    const std::string path = folder_.file("tokens");
    std::ofstream(path) << text;
    ::chmod(path.c_str(), mode);
    return Tokens::read(path);
  }
  test::TemporaryFolder folder_;
};

TEST_F(TokensTest, ATokenIsKnownByItsHashAlone) {
  const auto tokens = read("# who may ask\n\ncam-7 cam " + kHash + "\n");
  ASSERT_TRUE(tokens) << tokens.error().message;
  const auto asker = tokens->asker_of("Bearer secret");
  ASSERT_TRUE(asker);
  EXPECT_EQ(asker->name, "cam-7");
  EXPECT_EQ(asker->role, Role::kCam);
  EXPECT_TRUE(tokens->asker_of("Basic " + to_base64("cam-7:secret"))) << "as browsers ask";
  for (const std::string& shown :
       {std::string(), std::string("Bearer "), std::string("Bearer other"), "Bearer " + kHash,
        "Basic " + to_base64("cam-8:secret"), std::string("secret")})
    EXPECT_FALSE(tokens->asker_of(shown)) << shown;
}

TEST_F(TokensTest, RefusesLinesThatAreNone) {
  EXPECT_FALSE(read(""));
  EXPECT_FALSE(read("cam-7 server " + kHash + "\n")) << "a server asks for nothing";
  EXPECT_FALSE(read("cam-7 cam secret\n")) << "a token itself does not stand in the file";
  EXPECT_FALSE(read("a cam " + kHash + "\nb cam " + kHash + "\n")) << "whose token is it";
  EXPECT_FALSE(read("cam-7 cam " + kHash + "\n", 0644)) << "everybody may read it";
}

TEST_F(TokensTest, Base64IsReadAndWrittenWhole) {
  for (const std::string& bytes : {std::string(), std::string("a"), std::string("ab"),
                                   std::string("abc"), std::string("\0\xff\n", 3)})
    EXPECT_EQ(from_base64(to_base64(bytes)), bytes);
  EXPECT_EQ(to_base64("abc"), "YWJj");
  EXPECT_FALSE(from_base64("YWJ"));
}

}  // namespace
}  // namespace trammel
