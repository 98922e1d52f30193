// The name that a participant is given, and for how long.
#include "server/dds/client_names.h"

#include <gtest/gtest.h>

#include <initializer_list>

#include "idl/transport/security.h"

namespace trammel {
namespace {

/// GUIDs that begin as DDS-Security has them begin: computed from the DER of the subjects, outside
/// this program.
std::string participant(std::initializer_list<unsigned char> begin, unsigned char process = 7) {
  std::string octets(begin.begin(), begin.end());
  octets.resize(12, static_cast<char>(process));
  return octets;
}
const std::string kEngineer = participant({0xf9, 0xcb, 0x78, 0xda, 0xea, 0xdf});
const std::string kEngineer2 = participant({0x8b, 0x44, 0x35, 0x03, 0x8d, 0x42});
const std::string kPrintable = participant({0xee, 0x34, 0x67, 0x3d, 0x7f, 0x72});
const std::string kUmlaut = participant({0xf7, 0x19, 0x33, 0x5e, 0x66, 0x5f});
constexpr const char* kClaim = "/O=Trammel/CN=engineer-1";
constexpr const char* kName = "CN=engineer-1,O=Trammel";

TEST(ConfirmedSubject, AClaimCountsWhereTheGuidHasItsHash) {
  EXPECT_EQ(wire::confirmed_subject(kClaim, kEngineer), kName);
  EXPECT_EQ(wire::confirmed_subject(kClaim, kPrintable), kName)
      << "however the authority encodes it";
  EXPECT_EQ(wire::confirmed_subject("/O=Fr\\xC3\\xA4serei A/B/CN=x", kUmlaut),
            "CN=x,O=Fr\\C3\\A4serei A/B");
  EXPECT_EQ(wire::confirmed_subject(kClaim, kEngineer2), "") << "a forged token";
  EXPECT_EQ(wire::confirmed_subject("/CN=engineer-1/O=Trammel", kEngineer), "") << "another order";
  for (const char* nonsense :
       {"", "/", "=", "/=", "/CN", "/CN=", "\\x", "/CN=\\x", "/CN=\\xC", "/CN=\\xZZ"})
    EXPECT_EQ(wire::confirmed_subject(nonsense, kEngineer), "") << nonsense;
  EXPECT_EQ(wire::confirmed_subject(kClaim, ""), "");
  EXPECT_EQ(wire::confirmed_subject(std::string(1 << 20, '/'), kEngineer), "");
}

TEST(ClientNames, OnlyWhoWasLetInHasAName) {
  ClientNames names;
  names.announced(kEngineer, kClaim);
  EXPECT_EQ(names.of(kEngineer), "") << "not yet";
  names.let_in(kEngineer);
  EXPECT_EQ(names.of(kEngineer), kName);
  names.announced(kEngineer, "/O=Trammel/CN=engineer-2");
  EXPECT_EQ(names.of(kEngineer), kName) << "what it says later";
  names.announced(kEngineer2, kClaim);
  names.let_in(kEngineer2);
  EXPECT_EQ(names.of(kEngineer2), "") << "a forged token";
  names.refused(kEngineer);
  EXPECT_EQ(names.of(kEngineer), "");
  EXPECT_EQ(names.of("nobody"), "");
}

TEST(ClientNames, WhoIsRefusedIsToldByWhatItHasSaidOfItself) {
  ClientNames names;
  EXPECT_EQ(names.refused(kEngineer), "says nothing of itself");
  names.announced(kEngineer, kClaim, "10.1.0.7");
  EXPECT_EQ(names.refused(kEngineer), "says it is CN=engineer-1,O=Trammel, at 10.1.0.7");
  names.announced(kEngineer2, "/CN=\nanna", "10.1.0.8");
  const std::string forged = names.refused(kEngineer2);
  EXPECT_TRUE(forged.ends_with(", which does not fit its GUID, at 10.1.0.8")) << forged;
  EXPECT_EQ(forged.find('\n'), std::string::npos) << forged;
  names.announced(kPrintable, "", "10.1.0.9");
  EXPECT_EQ(names.refused(kPrintable), "shows no certificate, at 10.1.0.9");
  names.left(kPrintable);
  EXPECT_EQ(names.refused(kPrintable), "says nothing of itself")
      << "forgotten with the participant";
}

TEST(ClientNames, ANameIsForgottenOnceItsRequestsAreOver) {
  ClientNames names;
  const ClientNames::Time now{};
  names.let_in(kEngineer);
  names.announced(kEngineer, kClaim);
  names.left(kEngineer, now);
  EXPECT_EQ(names.of(kEngineer), kName) << "a request of it may still wait";
  names.left(kEngineer2, now + ClientNames::kKept * 2);
  EXPECT_EQ(names.of(kEngineer), "");
}

TEST(ClientNames, WhoComesUnderAnOldGuidIsLetInAnew) {
  ClientNames names;
  names.announced(kEngineer, kClaim);
  names.let_in(kEngineer);
  names.left(kEngineer);
  names.announced(kEngineer, kClaim);
  EXPECT_EQ(names.of(kEngineer), "");
  names.let_in(kEngineer);
  EXPECT_EQ(names.of(kEngineer), kName);
}

}  // namespace
}  // namespace trammel
