#include "server/config/server_config.h"

#include <gtest/gtest.h>

#include "tests/support/refusal.h"
#include "tests/support/small_cell.h"
#include "tests/support/temporary_folder.h"

namespace trammel {
namespace {

using test::Refusal;

const std::string kShipped = TRAMMEL_SOURCE_DIR "/config/server.yaml";

class ServerConfigTest : public testing::Test {
 protected:
  ServerConfigTest() {
    folder_.write("robot.yaml", test::small_robot_yaml());
    folder_.write("cell-7.yaml", test::small_cell_yaml("cell-7"));
    folder_.write("cell-8.yaml", test::small_cell_yaml("cell-8"));
  }
  /// The refusal of the minimal file with `more` at its end.
  Refusal refusal_for(const std::string& more) const { return refusal_of(kMinimal + more); }
  Refusal refusal_of(const std::string& text) const {
    return test::refusal_of(read_server_config(folder_.write("server.yaml", text)));
  }
  Refusal at(std::optional<long> line, const std::string& field = "") const {
    return Refusal(folder_.file("server.yaml"), line, field);
  }
  ServerConfig read(const std::string& more) const {
    auto config = read_server_config(folder_.write("server.yaml", kMinimal + more));
    EXPECT_TRUE(config) << config.error().message;
    return config.value_or(ServerConfig{});
  }

  static inline const std::string kMinimal =
      "version: 1\nserver: a\ncells: [cell-7.yaml]\nstore: t.db\n";
  test::TemporaryFolder folder_;
};

TEST_F(ServerConfigTest, WhatShipsLoads) {
  const auto config = read_server_config(kShipped);
  ASSERT_TRUE(config) << config.error().message;
  EXPECT_TRUE(config->cells.contains("cell-7"));
}

TEST_F(ServerConfigTest, WhatShipsSaysTheDefaults) {
  const auto shipped = read_server_config(kShipped);
  ASSERT_TRUE(shipped) << shipped.error().message;
  const ServerConfig minimal = read("");
  EXPECT_EQ(shipped->dds.domain, minimal.dds.domain);
  EXPECT_EQ(shipped->dds.address, minimal.dds.address);
  EXPECT_EQ(shipped->dds.port, minimal.dds.port);
  EXPECT_EQ(shipped->dds.compute_workers, minimal.dds.compute_workers);
  EXPECT_EQ(shipped->dds.max_clients, minimal.dds.max_clients);
  EXPECT_EQ(shipped->dds.client_requests, minimal.dds.client_requests);
  EXPECT_EQ(shipped->dds.client_mb, minimal.dds.client_mb);
  EXPECT_EQ(shipped->dds.queued_requests, minimal.dds.queued_requests);
  EXPECT_EQ(shipped->dds.queued_mb, minimal.dds.queued_mb);
  EXPECT_EQ(shipped->dds.cell_share, minimal.dds.cell_share);
  EXPECT_FALSE(shipped->dds.ros2);
  EXPECT_EQ(shipped->dds.record, minimal.dds.record);
  EXPECT_EQ(shipped->trainer.queue_capacity, minimal.trainer.queue_capacity);
  EXPECT_EQ(shipped->trainer.max_poses, minimal.trainer.max_poses);
  EXPECT_EQ(shipped->trainer.validation_share, minimal.trainer.validation_share);
  EXPECT_EQ(shipped->trainer.accept_ratio, minimal.trainer.accept_ratio);
  EXPECT_EQ(shipped->trainer.seed, minimal.trainer.seed);
  EXPECT_EQ(shipped->trainer.compute.memory_mb, minimal.trainer.compute.memory_mb);
  EXPECT_EQ(shipped->trainer.compute.cpu_s, minimal.trainer.compute.cpu_s);
  EXPECT_EQ(shipped->models_in_memory, minimal.models_in_memory);
  EXPECT_EQ(shipped->log.level, minimal.log.level);
  EXPECT_EQ(shipped->log.file, minimal.log.file);
  EXPECT_EQ(shipped->log.format, minimal.log.format);
  EXPECT_EQ(shipped->http.address, minimal.http.address);
  EXPECT_EQ(shipped->http.port, minimal.http.port);
  EXPECT_FALSE(shipped->http.api);
  EXPECT_EQ(shipped->http.tokens, minimal.http.tokens);
}

TEST_F(ServerConfigTest, WhatShipsHasEveryKeyWithAComment) {
  const std::string shipped = test::read_file(kShipped);
  for (const std::string section : {"", "dds: ", "trainer: ", "log: ", "http: "}) {
    const std::string more = section.empty() ? "bogus: 1\n" : section + "{bogus: 1}\n";
    const auto config = read_server_config(folder_.write("server.yaml", kMinimal + more));
    ASSERT_FALSE(config);
    std::istringstream keys(config.error().next.substr(std::string("known here: ").size()));
    for (std::string key; keys >> key;) {
      const auto at = shipped.find((section.empty() ? "\n" : "\n  ") + key + ":");
      ASSERT_NE(at, std::string::npos) << key << " is not in " << kShipped;
      if (key == "version" || key == "dds" || key == "trainer" || key == "log" || key == "http")
        continue;
      EXPECT_NE(shipped.substr(at + 1, shipped.find('\n', at + 1) - at).find('#'),
                std::string::npos)
          << key;
    }
  }
}

TEST_F(ServerConfigTest, OtherHostsAskOverHttpOnlyWithTokensAndTls) {
  const std::string open = "address: 192.168.1.4, allow_network: true, api: true";
  const std::string tls = ", certificate: c.pem, key: k.pem";
  for (const std::string& guards : {std::string(), std::string(", tokens: tokens"), tls,
                                    std::string(", tokens: tokens, certificate: c.pem")})
    EXPECT_FALSE(read_server_config(
        folder_.write("server.yaml", kMinimal + "http: {" + open + guards + "}\n")))
        << guards;
  const auto config = read_server_config(
      folder_.write("server.yaml", kMinimal + "http: {" + open + ", tokens: tokens" + tls + "}\n"));
  ASSERT_TRUE(config) << config.error().message;
  EXPECT_TRUE(config->http.api);
  EXPECT_TRUE(config->http.tokens.ends_with("/tokens")) << "relative to the server file";
}

TEST_F(ServerConfigTest, PagesStayOnThisHostWhateverTheFileSays) {
  for (const char* address : {"0.0.0.0", "192.168.1.4", "localhost", "::1", "plant"}) {
    const auto config = read_server_config(
        folder_.write("server.yaml", kMinimal + fmt::format("http: {{address: '{}'}}\n", address)));
    ASSERT_FALSE(config) << address;
    EXPECT_NE(sentence(config.error()).find("stay on this host"), std::string::npos)
        << sentence(config.error());
  }
  EXPECT_FALSE(read_server_config(folder_.write("server.yaml", kMinimal + "http: {port: 80}\n")));
}

TEST_F(ServerConfigTest, LetsNoNodesInBesideSecurityWhereTheyHaveNoRole) {
  const auto config = read_server_config(
      folder_.write("server.yaml", kMinimal + "dds: {ros2: true, security: certificates}\n"));
  ASSERT_FALSE(config);
  EXPECT_NE(sentence(config.error()).find("ros2"), std::string::npos) << sentence(config.error());
}

TEST_F(ServerConfigTest, ReadsEveryKey) {
  const ServerConfig config = read(
      "models_in_memory_mb: 512\n"
      "dds: {domain: 3, address: 127.0.0.2, port: 18000, compute_workers: 4, max_clients: 7, "
      "client_requests: 8, client_mb: 90, queued_requests: 10, queued_mb: 110, cell_share: 0.75, "
      "ros2: true}\n"
      "trainer: {queue_capacity: 2, max_poses: 300, validation_share: 0.3, accept_ratio: 1.5, "
      "seed: 9, memory_mb: 64, cpu_s: 30}\n"
      "log: {level: debug, file: trammel.log, format: json}\n"
      "http: {address: 127.0.0.2, port: 9464}\n");
  EXPECT_EQ(config.log.format, "json");
  EXPECT_EQ(config.http.address, "127.0.0.2");
  EXPECT_EQ(config.http.port, 9464);
  EXPECT_EQ(config.dds.server_id, "a");
  EXPECT_EQ(config.store, folder_.file("t.db")) << "relative to the file";
  EXPECT_EQ(config.models_in_memory, std::size_t{512} << 20);
  EXPECT_EQ(config.dds.domain, 3u);
  EXPECT_EQ(config.dds.address, "127.0.0.2");
  EXPECT_EQ(config.dds.port, 18000);
  EXPECT_EQ(config.dds.compute_workers, 4);
  EXPECT_EQ(config.dds.max_clients, 7);
  EXPECT_EQ(config.dds.client_requests, 8);
  EXPECT_EQ(config.dds.client_mb, 90);
  EXPECT_EQ(config.dds.queued_requests, 10);
  EXPECT_EQ(config.dds.queued_mb, 110);
  EXPECT_EQ(config.dds.cell_share, 0.75);
  EXPECT_TRUE(config.dds.ros2);
  EXPECT_EQ(config.trainer.queue_capacity, 2);
  EXPECT_EQ(config.trainer.max_poses, 300);
  EXPECT_EQ(config.trainer.validation_share, 0.3);
  EXPECT_EQ(config.trainer.accept_ratio, 1.5);
  EXPECT_EQ(config.trainer.seed, 9u);
  EXPECT_EQ(config.trainer.compute.memory_mb, 64);
  EXPECT_EQ(config.trainer.compute.cpu_s, 30);
  EXPECT_EQ(config.log.level, "debug");
  EXPECT_EQ(config.log.file, folder_.file("trammel.log"));
}

TEST_F(ServerConfigTest, RefusesUnknownDoubledAndMissingKeys) {
  EXPECT_EQ(refusal_for("dds: {prot: 17500}\n"), at(5, "dds: prot"));
  EXPECT_EQ(refusal_for("trainer: {}\ntrainer: {}\n"), at(5, "trainer"));
  EXPECT_EQ(refusal_of("version: 1\nserver: a\nstore: t.db\n"), at(1, "cells"));
  EXPECT_EQ(refusal_of("server: a\ncells: [cell-7.yaml]\nstore: t.db\n"),
            at(1, "version").beyond(0, 1));
}

TEST_F(ServerConfigTest, APartAmongServersThatFollowEachOtherIsRefusedWithWhatToDoInstead) {
  for (const char* part : {"replica: {role: follower, of: b}\n", "replica: null\n"}) {
    const auto refused = read_server_config(folder_.write("server.yaml", kMinimal + part));
    ASSERT_FALSE(refused) << part;
    EXPECT_EQ(refused.error().field, "replica");
    EXPECT_NE(sentence(refused.error()).find("`store: postgresql://...`"), std::string::npos)
        << sentence(refused.error());
  }
}

TEST_F(ServerConfigTest, RefusesValuesOutOfRangeAndSaysTheLimit) {
  EXPECT_EQ(refusal_for("dds: {port: 80}\n"), at(5, "dds: port").beyond(80, 1024));
  EXPECT_EQ(refusal_for("dds: {domain: 233}\n"), at(5, "dds: domain").beyond(233, 232));
  EXPECT_EQ(refusal_for("dds: {compute_workers: 0}\n"), at(5, "dds: compute_workers").beyond(0, 1));
  EXPECT_EQ(refusal_for("record: {folder: r, max_mb: 1}\n"), at(5, "record: max_mb").beyond(1, 8));
  EXPECT_EQ(refusal_for("trainer: {validation_share: 0}\n"),
            at(5, "trainer: validation_share").beyond(0, 0.05));
  EXPECT_EQ(refusal_for("trainer: {accept_ratio: -1}\n"),
            at(5, "trainer: accept_ratio").beyond(-1, 0.1));
  EXPECT_EQ(refusal_for("trainer: {seed: -1}\n"), at(5, "trainer: seed").beyond(-1, 0));
  EXPECT_EQ(refusal_for("trainer: {memory_mb: 63}\n"), at(5, "trainer: memory_mb").beyond(63, 64));
  EXPECT_EQ(refusal_for("trainer: {cpu_s: 0}\n"), at(5, "trainer: cpu_s").beyond(0, 1));
  EXPECT_EQ(refusal_for("log: {level: loud}\n"), at(5, "log: level").text("loud"));
}

TEST_F(ServerConfigTest, RefusesWrongTypes) {
  EXPECT_EQ(refusal_for("trainer: {queue_capacity: many}\n"),
            at(5, "trainer: queue_capacity").text("many"));
  EXPECT_EQ(refusal_for("trainer: {validation_share: .nan}\n"),
            at(5, "trainer: validation_share").text(".nan"));
  EXPECT_EQ(refusal_for("dds: 17500\n"), at(5, "dds"));
  EXPECT_EQ(refusal_for("dds: {allow_network: maybe, address: 10.0.0.1}\n"),
            at(5, "dds: allow_network").text("maybe"));
  EXPECT_EQ(refusal_of("- a\n- b\n"), at(1));
  EXPECT_EQ(refusal_of("version: [1\n"), at(2));
}

TEST_F(ServerConfigTest, RefusesAWordOfConsentThatIsNoneAlsoWhereTheAddressDoesNotNeedIt) {
  for (const char* key : {"allow_network", "without_security"}) {
    const std::string field = fmt::format("dds: {}", key);
    EXPECT_EQ(refusal_for(fmt::format("dds: {{{}: nope}}\n", key)), at(5, field).text("nope"));
    EXPECT_EQ(refusal_for(fmt::format("dds: {{{}: 7}}\n", key)), at(5, field).text("7"));
    for (const char* no_word : {"[1]", "null", "{a: 1}"}) {
      const auto read = read_server(
          folder_.write("server.yaml", kMinimal + fmt::format("dds: {{{}: {}}}\n", key, no_word)));
      ASSERT_EQ(read.problems.size(), 1u) << key << ": " << no_word;
      EXPECT_EQ(read.problems[0].field, field) << no_word;
      EXPECT_EQ(read.problems[0].row, 5) << no_word;
    }
  }
  const auto both = read_server(folder_.write(
      "server.yaml",
      kMinimal + "dds: {address: 192.168.1.5, allow_network: nope, without_security: nope}\n"));
  EXPECT_EQ(both.problems.size(), 2u) << "each by itself, and not the address";
}

TEST_F(ServerConfigTest, RefusesAnAddressThatLeavesTheHostUnlessThatIsMeant) {
  EXPECT_EQ(refusal_for("dds: {address: 192.168.1.5}\n"),
            at(5, "dds: address").text("192.168.1.5"));
  EXPECT_EQ(refusal_for("dds: {address: 0.0.0.0}\n"), at(5, "dds: address").text("0.0.0.0"));
  EXPECT_EQ(refusal_for("dds: {address: localhost}\n"), at(5, "dds: address").text("localhost"));
  EXPECT_EQ(refusal_for("dds: {address: 192.168.1.5, allow_network: true}\n"),
            at(5, "dds: address").text("192.168.1.5"));
  EXPECT_EQ(read("dds: {address: 192.168.1.5, allow_network: true, without_security: true}\n")
                .dds.address,
            "192.168.1.5");
  const ServerConfig secured =
      read("dds: {address: 192.168.1.5, allow_network: true, security: keys}\n");
  EXPECT_EQ(secured.dds.address, "192.168.1.5");
  EXPECT_EQ(secured.dds.security, folder_.file("keys"));
}

TEST_F(ServerConfigTest, DiscoveryServersAreFewDifferentAndWithinReach) {
  const std::vector<HostPort> expected = {{"127.0.0.1", 11811}, {"127.0.0.1", 11812}};
  EXPECT_EQ(
      read("dds: {discovery_servers: [127.0.0.1, '127.0.0.1:11812']}\n").dds.discovery_servers,
      expected);
  EXPECT_EQ(refusal_for("dds: {discovery_servers: ['127.0.0.1:80']}\n"),
            at(5, "dds: discovery_servers").text("127.0.0.1:80"));
  EXPECT_EQ(refusal_for("dds: {discovery_servers: [127.0.0.1, '127.0.0.1:11811']}\n"),
            at(5, "dds: discovery_servers").text("127.0.0.1:11811"));
  EXPECT_EQ(refusal_for("dds: {discovery_servers: [10.1.0.4]}\n"),
            at(5, "dds: discovery_servers").text("10.1.0.4"));
  EXPECT_EQ(refusal_for("dds: {discovery_servers: ['127.0.0.1:2001', '127.0.0.1:2002', "
                        "'127.0.0.1:2003', '127.0.0.1:2004', '127.0.0.1:2005', '127.0.0.1:2006', "
                        "'127.0.0.1:2007', '127.0.0.1:2008', '127.0.0.1:2009']}\n"),
            at(5, "dds: discovery_servers").beyond(9, 8));
}

TEST_F(ServerConfigTest, RefusesServerNamesThatTheWireCannotCarry) {
  for (const std::string& name : {std::string("\"\""), std::string("a b"), std::string(65, 'x')}) {
    EXPECT_EQ(refusal_of("version: 1\nserver: " + name + "\ncells: [cell-7.yaml]\nstore: t.db\n"),
              at(2, "server").text(name == "\"\"" ? "" : name));
  }
}

TEST_F(ServerConfigTest, RefusesTwoCellsOfOneNameAndACellThatCannotBeRead) {
  const std::string start = "version: 1\nserver: a\nstore: t.db\n";
  folder_.write("copy.yaml", test::small_cell_yaml("cell-7"));
  EXPECT_EQ(refusal_of(start + "cells: [cell-7.yaml, copy.yaml]\n"),
            at({}, "cells").text("cell-7"));
  EXPECT_EQ(refusal_of(start + "cells: [nowhere.yaml]\n"), Refusal(folder_.file("nowhere.yaml")));
  EXPECT_EQ(refusal_of(start + "cells: []\n"), at(4, "cells").beyond(0, 1));
}

TEST_F(ServerConfigTest, RefusesAFileThatIsNotThere) {
  EXPECT_FALSE(read_server_config(folder_.file("nowhere.yaml")));
}

}  // namespace
}  // namespace trammel
