#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "clients/cli/command_line.h"
#include "server/base/text_file.h"
#include "server/base/units.h"
#include "server/compensate/model_file.h"
#include "server/measurement/files/csv_table.h"
#include "tests/support/small_cell.h"
#include "tests/support/temporary_folder.h"

namespace trammel::cli {
namespace {

namespace fs = std::filesystem;
using namespace std::string_literals;

constexpr int kProgramNotAll = 1;
constexpr int kProgramWrongUsage = 2;
constexpr int kProgramRefusedData = 3;

const std::string kProgramsFolder = TRAMMEL_SOURCE_DIR "/config/programs/";

/// A model of the shipped cell that knows of no errors: what is corrected is written as it was,
/// with its digits.
class CorrectProgram : public testing::Test {
 protected:
  void SetUp() override {
    const Result<Cell> cell = read_cell(TRAMMEL_SOURCE_DIR "/config/cell-7.yaml");
    folder_.write("cell.model",
                  serialize(test::nominal_model(std::make_shared<const Cell>(*cell), 10)));
  }
  int correct(std::vector<std::string> arguments) { return run("correct", std::move(arguments)); }
  int run(const char* command, std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {"trammel", command});
    std::vector<const char*> argv;
    for (const std::string& argument : arguments) argv.push_back(argument.c_str());
    return run_command_line(static_cast<int>(argv.size()), argv.data());
  }
  std::string file(const std::string& name) const { return folder_.file(name); }
  std::string text(const std::string& name) const { return read_text_file(file(name)).value(); }
  bool exists(const std::string& name) const { return fs::exists(file(name)); }
  const std::string model() const { return file("cell.model"); }

  /// A module with one target that is corrected and, if asked for, one that is decided at run time.
  std::string module(const std::string& name, bool some_left = false) {
    std::string lines = "    MoveL p10,v100,fine,tSpindle;\n";
    if (some_left) lines += "    MoveL CRobT(),v100,fine,tSpindle;\n";
    return folder_.write(
        name,
        "MODULE M\r\n  PERS tooldata "
        "tSpindle:=[TRUE,[[100,0,150],[0.923879533,0,-0.382683432,0]],[100,[0,0,100],[1,0,0,0],0,0,"
        "0]];\r\n"
        "  CONST robtarget "
        "p10:=[[1800.1,0,1000],[0.669131,0,0.743145,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\n"
        "  PROC main()\n" +
            lines + "  ENDPROC\nENDMODULE\n");
  }

  test::TemporaryFolder folder_;
};

TEST_F(CorrectProgram, WhatItWasBeforeIsKeptBesideItAndRestoredByteForByte) {
  const std::string before = module("m.mod");
  ASSERT_EQ(correct({"--model", model(), before, "-o", file("out.mod"), "--receipt", file("r.csv"),
                     "--json", file("r.json")}),
            0);
  EXPECT_EQ(text("out.mod.original"), text("m.mod"));
  EXPECT_NE(text("out.mod"), text("m.mod"));
  ASSERT_EQ(correct({"--undo", file("out.mod"), "-o", file("back.mod")}), 0);
  EXPECT_EQ(text("back.mod"), text("m.mod"));

  const CsvTable receipt = CsvTable::parse(text("r.csv"), "r.csv").value();
  EXPECT_EQ(receipt.field(0, receipt.find("name").value()), "p10");
  EXPECT_EQ(receipt.field(0, receipt.find("status").value()), "ok");
  const auto told_json = nlohmann::json::parse(text("r.json"));
  EXPECT_EQ(told_json["moves_corrected"], 1);
  EXPECT_EQ(told_json["inserted_lines"].size(), 1u);
}

/// As Windows stores a text with letters of its own: two bytes each, the lower or the higher one
/// first; `marked`: behind a byte order mark.
std::string stored_in_utf16(const std::string& ascii, bool big, bool marked) {
  std::string bytes = !marked ? "" : big ? "\xFE\xFF" : "\xFF\xFE";
  for (const char c : ascii) bytes += big ? std::string{'\0', c} : std::string{c, '\0'};
  return bytes;
}

TEST_F(CorrectProgram, AProgramInUtf16IsWrittenInUtf16AndUndoneByteForByte) {
  module("plain.mod");
  ASSERT_EQ(correct({"--model", model(), file("plain.mod"), "-o", file("out-plain.mod")}), 0);
  const std::string plain = text("out-plain.mod");
  const std::size_t begins = plain.find("robtarget p10");
  ASSERT_NE(begins, std::string::npos) << plain;
  const std::string robtarget = plain.substr(begins, plain.find('\n', begins) - begins);
  ASSERT_EQ(text("plain.mod").find(robtarget), std::string::npos) << "it is not corrected";
  for (const bool big : {false, true}) {
    for (const bool marked : {false, true}) {
      folder_.write("wide.mod", stored_in_utf16(text("plain.mod"), big, marked));
      ASSERT_EQ(correct({"--model", model(), file("wide.mod"), "-o", file("out.mod")}), 0);
      EXPECT_EQ(text("out.mod.original"), text("wide.mod"));
      const std::string wide = text("out.mod");
      EXPECT_EQ(wide.size() % 2, 0u);
      EXPECT_EQ(wide.starts_with(big ? "\xFE\xFF" : "\xFF\xFE"), marked);
      EXPECT_NE(wide.find(stored_in_utf16(robtarget, big, false)), std::string::npos);
      EXPECT_NE(wide.find(stored_in_utf16("TRAMMEL model=", big, false)), std::string::npos);
      if (!marked) {
        EXPECT_EQ(wide, stored_in_utf16(plain, big, false));
      }
      ASSERT_EQ(correct({"--undo", file("out.mod"), "-o", file("back.mod")}), 0);
      EXPECT_EQ(text("back.mod"), text("wide.mod"));
    }
  }
}

TEST_F(CorrectProgram, LettersOfOtherScriptsInUtf16StayAsTheyAre) {
  const std::string name = "\xE4\0\x2D\x4E\x3D\xD8\x00\xDE"s;  // an umlaut, a sign, a pair
  const std::string comment =
      stored_in_utf16("! ", false, false) + name + stored_in_utf16("\r\n", false, false);
  module("plain.mod");
  const std::string rest = stored_in_utf16(text("plain.mod"), false, false);
  folder_.write("wide.mod", "\xFF\xFE" + comment + rest);
  ASSERT_EQ(correct({"--model", model(), file("wide.mod"), "-o", file("out.mod")}), 0);
  EXPECT_NE(text("out.mod").find(comment), std::string::npos);
  ASSERT_EQ(correct({"--undo", file("out.mod"), "-o", file("back.mod")}), 0);
  EXPECT_EQ(text("back.mod"), text("wide.mod"));
}

TEST_F(CorrectProgram, Utf16ThatIsBrokenIsRefusedWithTheWayOut) {
  module("plain.mod");
  const std::string wide = "\xFF\xFE" + stored_in_utf16(text("plain.mod"), false, false);
  for (const std::string& broken : {wide + "x", wide + "\x3D\xD8"s, wide + "\0\0"s}) {
    folder_.write("wide.mod", broken);
    testing::internal::CaptureStderr();
    EXPECT_EQ(correct({"--model", model(), file("wide.mod"), "-o", file("out.mod")}),
              kProgramRefusedData);
    const std::string said = testing::internal::GetCapturedStderr();
    EXPECT_NE(said.find("text in UTF-16, expected UTF-8"), std::string::npos) << said;
    EXPECT_NE(said.find("save it as UTF-8"), std::string::npos) << said;
  }
}

TEST_F(CorrectProgram, WithoutItsOriginalOrWithAnotherOneNothingIsUndone) {
  const std::string before = module("m.mod");
  ASSERT_EQ(correct({"--model", model(), before, "-o", file("out.mod")}), 0);
  EXPECT_EQ(correct({"--undo", before, "-o", file("back.mod")}), kProgramRefusedData)
      << "it is not marked";
  folder_.write("out.mod.original", "MODULE Other\nENDMODULE\n");
  EXPECT_EQ(correct({"--undo", file("out.mod"), "-o", file("back.mod")}), kProgramRefusedData);
  fs::remove(file("out.mod.original"));
  EXPECT_EQ(correct({"--undo", file("out.mod"), "-o", file("back.mod")}), kProgramRefusedData);
  EXPECT_FALSE(exists("back.mod"));
}

TEST_F(CorrectProgram, ACorrectedProgramIsCorrectedAgainOnlyFromItsOriginal) {
  ASSERT_EQ(correct({"--model", model(), module("m.mod"), "-o", file("out.mod")}), 0);
  EXPECT_EQ(correct({"--model", model(), file("out.mod"), "-o", file("twice.mod")}),
            kProgramRefusedData);
  EXPECT_FALSE(exists("twice.mod"));
  ASSERT_EQ(correct({"--again", "--model", model(), file("out.mod"), "-o", file("twice.mod")}), 0);
  EXPECT_EQ(text("twice.mod"), text("out.mod"));
  EXPECT_EQ(text("twice.mod.original"), text("m.mod"));
}

TEST_F(CorrectProgram, WhatIsLeftDecidesTheExitCode) {
  const std::string before = module("m.mod", true);
  EXPECT_EQ(correct({"--model", model(), before, "-o", file("strict.mod"), "--strict"}),
            kProgramRefusedData);
  EXPECT_FALSE(exists("strict.mod"));
  EXPECT_EQ(correct({"--model", model(), before, "-o", file("out.mod")}), kProgramNotAll);
  EXPECT_EQ(correct({"--model", model(), before, "-o", file("allowed.mod"), "--allow-failed"}), 0);
  EXPECT_EQ(text("allowed.mod"), text("out.mod"));
}

TEST_F(CorrectProgram, AStrictToleranceWritesNothingWhereATargetIsOutOfDomain) {
  const std::string before = module("m.mod");
  ModelParts learned_elsewhere = load_model(model()).value().parts();
  learned_elsewhere.q_min.setConstant(from_deg(-1));
  learned_elsewhere.q_max.setConstant(from_deg(1));
  folder_.write("elsewhere.model",
                serialize(CompensatedModel::make(std::move(learned_elsewhere)).value()));
  const auto corrected = [&](const std::string& by, const std::string& out,
                             std::vector<std::string> more) {
    more.insert(more.begin(), {"--model", file(by), before, "-o", file(out), "--tolerance", "0.2",
                               "--receipt", file(out + ".csv"), "--json", file(out + ".json")});
    return correct(std::move(more));
  };
  EXPECT_EQ(corrected("elsewhere.model", "strict.mod", {"--strict"}), kProgramRefusedData);
  for (const char* name :
       {"strict.mod", "strict.mod.original", "strict.mod.csv", "strict.mod.json"})
    EXPECT_FALSE(exists(name)) << name;
  EXPECT_EQ(corrected("elsewhere.model", "told.mod", {}), 0) << "without --strict it is only told";
  EXPECT_EQ(nlohmann::json::parse(text("told.mod.json"))["tolerance"]["out_of_domain"], 1);
  EXPECT_EQ(corrected("cell.model", "in_domain.mod", {"--strict"}), 0);
  EXPECT_TRUE(exists("in_domain.mod"));
}

TEST_F(CorrectProgram, WrongUsageChangesNothing) {
  const std::string before = module("m.mod");
  const std::string was = text("m.mod");
  EXPECT_EQ(correct({before, "-o", file("out.mod")}), kProgramWrongUsage) << "no model";
  EXPECT_EQ(correct({"--model", model(), before, "-o", before}), kProgramWrongUsage)
      << "over its input";
  EXPECT_EQ(correct({"--model", model(), "--format", "fortran", before, "-o", file("out.mod")}),
            kProgramWrongUsage);
  EXPECT_EQ(correct({"--model", model(), "--tool", "gripper", before, "-o", file("out.mod")}),
            kProgramWrongUsage);
  EXPECT_EQ(correct({"--model", model(), folder_.write("x.txt", "x"), "-o", file("out.mod")}),
            kProgramWrongUsage);
  EXPECT_EQ(text("m.mod"), was);
  EXPECT_FALSE(exists("out.mod"));
}

TEST_F(CorrectProgram, AToolOfAnotherCellIsRefusedAndNothingIsWritten) {
  std::string other = read_text_file(module("m.mod")).value();
  other.replace(other.find("[100,0,150]"), 11, "[100.2,0,150]");
  EXPECT_EQ(correct({"--model", model(), folder_.write("o.mod", other), "-o", file("out.mod")}),
            kProgramRefusedData);
  EXPECT_FALSE(exists("out.mod"));
}

TEST_F(CorrectProgram, AFolderComesBackAsAFolder) {
  fs::create_directory(file("in"));
  fs::rename(module("m.mod"), file("in/m.mod"));
  folder_.write("in/empty.sys", "MODULE E(SYSMODULE)\nENDMODULE\n");
  ASSERT_EQ(correct({"--model", model(), file("in"), "-o", file("out")}), 0);
  EXPECT_EQ(text("out/m.mod.original"), text("in/m.mod"));
  EXPECT_EQ(text("out/empty.sys"), text("in/empty.sys"));
  EXPECT_FALSE(exists("out/empty.sys.original"));
  ASSERT_EQ(correct({"--undo", file("out"), "-o", file("back")}), 0);
  EXPECT_EQ(text("back/m.mod"), text("in/m.mod"));
}

/// A KUKA folder as its archive has it: a position that a motion of the program goes to stands in
/// the controller's own file.
void write_krl_folder(const test::TemporaryFolder& folder, const std::string& under) {
  const std::string config = read_text_file(kProgramsFolder + "$config.dat").value();
  for (const char* place : {"/KRC/R1/System", "/KRC/R1/Program"})
    fs::create_directories(folder.file(under + place));
  folder.write(under + "/KRC/R1/System/$config.dat",
               config.substr(0, config.rfind("ENDDAT")) +
                   "DECL E6POS XHOME={X 0.0,Y 125.0,Z 100.0,A 0.0,B 90.0,C 0.0,S 2,T 0}\nENDDAT\n");
  const std::string drill = read_text_file(kProgramsFolder + "drill.src").value();
  folder.write(under + "/KRC/R1/Program/drill.src",
               drill.substr(0, drill.rfind("END")) + "PTP XHOME\nEND\n");
  folder.write(under + "/KRC/R1/Program/drill.dat",
               read_text_file(kProgramsFolder + "drill.dat").value());
}

TEST_F(CorrectProgram, AFolderRunLeavesTheControllersOwnFilesAsTheyAre) {
  write_krl_folder(folder_, "in");
  const std::string config = "/KRC/R1/System/$config.dat", program = "/KRC/R1/Program/drill.dat";
  EXPECT_EQ(
      correct({"--model", model(), file("in"), "-o", file("out"), "--receipt", file("r.csv")}),
      kProgramNotAll);
  EXPECT_EQ(text("out" + config), text("in" + config));
  EXPECT_FALSE(exists("out" + config + ".original"));
  EXPECT_NE(text("out" + program), text("in" + program)) << "the program itself is corrected";
  EXPECT_NE(text("r.csv").find("system file of the controller"), std::string::npos)
      << text("r.csv");
  EXPECT_EQ(correct({"--model", model(), file("in" + config), file("in/KRC/R1/Program/drill.src"),
                     file("in" + program), "-o", file("asked/")}),
            0);
  EXPECT_NE(text("asked/$config.dat"), text("in" + config)) << "asked for by its name";
}

TEST_F(CorrectProgram, SystemModulesOfAFolderStayWhereverTheyLie) {
  fs::create_directories(file("in"));
  fs::copy(kProgramsFolder + "drill.mod", file("in/User.sys"));
  EXPECT_EQ(correct({"--model", model(), file("in"), "-o", file("out")}), kProgramNotAll);
  EXPECT_EQ(text("out/User.sys"), text("in/User.sys"));
  EXPECT_EQ(correct({"--model", model(), file("in/User.sys"), "-o", file("asked.sys")}), 0);
  EXPECT_NE(text("asked.sys"), text("in/User.sys"));
}

TEST_F(CorrectProgram, PulsesAreToldInSixNumbersAndOfYaskawaJobsAlone) {
  const auto with = [&](const char* program, const char* pulses) {
    return correct({"--model", model(), kProgramsFolder + program, "-o", file("out.txt"),
                    "--frames", kProgramsFolder + "frames.csv", "--pulses-per-deg", pulses});
  };
  EXPECT_EQ(with("drill.jbi", "1000,1000,1000,1000,1000,1000"), 0);
  EXPECT_EQ(with("drill.jbi", "1000,1000,1000"), kProgramWrongUsage);
  EXPECT_EQ(with("drill.jbi", "1000,1000,0,1000,1000,1000"), kProgramWrongUsage);
  EXPECT_EQ(with("drill.mod", "1000,1000,1000,1000,1000,1000"), kProgramWrongUsage);
}

TEST_F(CorrectProgram, ADatFileOfAFolderIsKrlOnlyWhereItLooksLikeIt) {
  for (const auto& [program, other] :
       {std::pair("drill.ls", "orderfil.dat"), std::pair("drill.jbi", "HOME2.DAT"),
        std::pair("drill.mod", "log.dat")}) {
    fs::remove_all(file("in"));
    fs::create_directories(file("in"));
    fs::copy(kProgramsFolder + program, file(std::string("in/") + program));
    folder_.write(std::string("in/") + other, "! options of this controller\n");
    EXPECT_EQ(correct({"--model", model(), file("in"), "-o", file("out"), "--frames",
                       kProgramsFolder + "frames.csv"}),
              0)
        << program;
  }
  write_krl_folder(folder_, "krl");
  EXPECT_EQ(correct({"--model", model(), file("krl"), "-o", file("krl-out")}), kProgramNotAll)
      << "its data lists are read";
  EXPECT_TRUE(exists("krl-out/KRC/R1/Program/drill.dat"));
}

TEST_F(CorrectProgram, RowsOfFramesThatNothingUsesAreRefusedWithTheNamesThereAre) {
  const std::string header = "name,x_mm,y_mm,z_mm,qw,qx,qy,qz";
  const std::string tool = "\nUTOOL[1],100,0,150,0.923879532511287,0,-0.382683432365090,0";
  const std::string frame = ",1800,-250,800,1,0,0,0";
  const auto with = [&](const std::string& rows, const std::string& command = "correct") {
    folder_.write("frames.csv", header + rows + "\n");
    testing::internal::CaptureStderr();
    const int code = run(command.c_str(), {"--model", model(), kProgramsFolder + "drill.ls", "-o",
                                           file("out"), "--frames", file("frames.csv")});
    return fmt::format("{}: {}", code, testing::internal::GetCapturedStderr());
  };
  EXPECT_TRUE(with(tool + "\nUFRAME[1]" + frame).starts_with("0: "));
  EXPECT_TRUE(with(tool + "\nUFRAME[1]" + frame + "\nrobot_base,0,0,0,1,0,0,0").starts_with("0: "));
  for (const char* name : {"UFRAME[2]", "UFRAM[1]", "robot_bas", "BASE_DATA[1]"}) {
    for (const char* command : {"correct", "predict"}) {
      const std::string said = with(tool + "\nUFRAME[1]" + frame + "\n" + name + frame, command);
      EXPECT_TRUE(said.starts_with("3: ")) << name << said;
      for (const std::string& part :
           {std::string("frames.csv row 4"), std::string(name), std::string("UFRAME[1]"),
            std::string("UTOOL[1]"), std::string("robot_base")})
        EXPECT_NE(said.find(part), std::string::npos) << name << ": " << said;
    }
  }
  EXPECT_TRUE(with(tool + "\nuframe[1]" + frame).starts_with("3: "))
      << "misspelt, and the frame is missing";
  EXPECT_TRUE(
      with(",may_be_unused" + tool + ",no\nUFRAME[1]" + frame + ",no\nUSER[3]" + frame + ",yes")
          .starts_with("0: "));
  EXPECT_TRUE(
      with(",may_be_unused" + tool + ",no\nUFRAME[1]" + frame + ",no\nUSER[3]" + frame + ",no")
          .starts_with("3: "));
  EXPECT_TRUE(
      with(",may_be_unused" + tool + ",no\nUFRAME[1]" + frame + ",maybe").starts_with("3: "));
}

TEST_F(CorrectProgram, FramesOfABackupServeEveryProgramOfIt) {
  ASSERT_EQ(run("import-backup", {kProgramsFolder + "backup", "--frames", file("frames.csv")}), 0);
  EXPECT_EQ(correct({"--model", model(), module("m.mod"), "-o", file("out.mod"), "--frames",
                     file("frames.csv")}),
            0);
}

TEST_F(CorrectProgram, ThePageHoldsEverythingItShows) {
  ASSERT_EQ(correct({"--model", model(), module("m.mod"), "-o", file("out.mod"), "--report",
                     file("page.html"), "--tolerance", "0.2", "--json", file("r.json")}),
            0);
  const std::string page = text("page.html");
  EXPECT_NE(page.find("1 of 1 targets are inside"), std::string::npos);
  EXPECT_NE(page.find("p10 m.mod:3"), std::string::npos);
  EXPECT_EQ(page.find("http"), std::string::npos) << "it loads something";
  EXPECT_EQ(page.find("{{"), std::string::npos);
  EXPECT_EQ(nlohmann::json::parse(text("r.json"))["tolerance"]["inside_after"], 1);
}

TEST_F(CorrectProgram, EveryShippedExampleIsCorrected) {
  const std::vector<std::vector<std::string>> examples = {
      {kProgramsFolder + "drill.mod"},
      {kProgramsFolder + "drill.src", kProgramsFolder + "drill.dat",
       kProgramsFolder + "$config.dat"},
      {kProgramsFolder + "drill.ls"},
      {kProgramsFolder + "drill.jbi"},
      {kProgramsFolder + "drill.script"},
      {"--format", "camrob", kProgramsFolder + "camrob.csv"},
      {"--format", "robodk", kProgramsFolder + "robodk.csv"},
  };
  for (const std::vector<std::string>& example : examples) {
    std::vector<std::string> arguments = example;
    arguments.insert(arguments.end(),
                     {"--model", model(), "--frames", kProgramsFolder + "frames.csv", "-o",
                      file("out/"), "--json", file("r.json")});
    EXPECT_EQ(correct(arguments), 0) << example.back();
    const auto told_json = nlohmann::json::parse(text("r.json"));
    EXPECT_EQ(told_json["left_alone"], 0) << example.back();
    EXPECT_EQ(told_json["moves"], told_json["moves_corrected"]) << example.back();
    EXPECT_GE(told_json["moves"].get<int>(), 2) << example.back();
  }
}

TEST_F(CorrectProgram, WhatIsPredictedOfAProgramIsWhereItsTargetsAre) {
  const std::string before = module("m.mod", true);
  EXPECT_EQ(
      run("predict", {"--model", model(), before, "-o", file("p.csv"), "--json", file("p.json")}),
      kProgramNotAll)
      << "CRobT() is decided at run time";
  const CsvTable table = CsvTable::parse(text("p.csv"), "p.csv").value();
  ASSERT_EQ(table.size(), 2u);
  const auto field = [&](const char* column) { return table.field(0, table.find(column).value()); };
  EXPECT_EQ(field("name"), "p10");
  EXPECT_EQ(field("status"), "ok");
  EXPECT_EQ(field("x_mm"), "1800.10000");
  EXPECT_EQ(field("px_mm"), "1800.10000") << "this model knows of no errors";
  EXPECT_EQ(field("error_mm"), "0.00000");
  EXPECT_EQ(table.field(1, table.find("px_mm").value()), "");
  EXPECT_EQ(nlohmann::json::parse(text("p.json"))["targets"][1]["status"], "refused");
  ASSERT_EQ(correct({"--model", model(), before, "-o", file("out.mod"), "--allow-failed"}), 0);
  EXPECT_EQ(run("predict", {"--model", model(), file("out.mod"), "-o", file("q.csv")}),
            kProgramNotAll)
      << "a corrected one, too";
  EXPECT_EQ(run("predict", {"--model", model(), "-o", file("q.csv")}), kProgramWrongUsage);
  EXPECT_EQ(run("predict", {"--model", model(), before, "--joints", before, "-o", file("q.csv")}),
            kProgramWrongUsage);
  EXPECT_EQ(run("predict", {"--model", model(), before, "--covariance", "-o", file("q.csv")}),
            kProgramWrongUsage);
}

TEST_F(CorrectProgram, WhereNoMotionIsUnderstoodNothingIsWritten) {
  for (const char* text : {"", "\x8f\x01\xe3\xff\x10\n\x99,\x02",
                           "MODULE M\n  PROC main()\n    Home;\n  ENDPROC\nENDMODULE\n"}) {
    for (const char* name : {"m.mod", "m.src", "m.ls", "m.jbi", "m.script"}) {
      const std::string path = folder_.write(name, text);
      EXPECT_EQ(correct({"--model", model(), path, "-o", file("out")}), kProgramRefusedData)
          << name << ": " << text;
      EXPECT_EQ(correct({"--model", model(), path, "-o", file("out"), "--allow-failed"}),
                kProgramRefusedData)
          << name;
      EXPECT_EQ(run("predict", {"--model", model(), path, "-o", file("out")}), kProgramRefusedData)
          << name;
      EXPECT_FALSE(exists("out"));
    }
  }
}

TEST_F(CorrectProgram, AFolderOfWhichSomeFilesHaveNoMotionIsCorrected) {
  fs::create_directory(file("in"));
  module("in/a.mod");
  const std::string home = "MODULE H\n  PROC home()\n  ENDPROC\nENDMODULE\n";
  folder_.write("in/h.mod", home);
  EXPECT_EQ(
      correct({"--model", model(), file("in"), "-o", file("out"), "--receipt", file("out/r.csv")}),
      0)
      << "the receipt may lie in the folder that is made";
  EXPECT_EQ(text("out/h.mod"), home);
  EXPECT_TRUE(exists("out/r.csv"));
}

TEST_F(CorrectProgram, AReceiptThatCannotBeWrittenLeavesNoCorrectedProgram) {
  const std::string before = module("m.mod");
  EXPECT_EQ(
      correct({"--model", model(), before, "-o", file("out.mod"), "--receipt", file("no/r.csv")}),
      kProgramRefusedData);
  EXPECT_EQ(
      correct({"--model", model(), before, "-o", file("out.mod"), "--report", file("no/r.html")}),
      kProgramRefusedData);
  EXPECT_EQ(
      correct({"--model", model(), before, "-o", file("out.mod"), "--receipt", file("out.mod")}),
      kProgramWrongUsage);
  EXPECT_EQ(correct({"--model", model(), before, "-o", file("out.mod"), "--receipt",
                     file("out.mod.original")}),
            kProgramWrongUsage);
  fs::create_directory(file("in"));
  const std::string inside = module("in/a.mod");
  const std::string was = read_text_file(inside).value();
  EXPECT_EQ(correct({"--model", model(), file("in"), "-o", file("out"), "--json", inside}),
            kProgramWrongUsage);
  EXPECT_EQ(
      correct({"--model", model(), file("in"), "-o", file("out"), "--json", file("out/a.mod")}),
      kProgramWrongUsage);
  EXPECT_EQ(read_text_file(inside).value(), was);
  EXPECT_FALSE(exists("out.mod"));
  EXPECT_FALSE(exists("out"));
  EXPECT_EQ(correct({"--model", model(), before, "-o", file("new/out.mod"), "--receipt",
                     file("new/r.csv")}),
            0);
}

TEST_F(CorrectProgram, MeasuringProgramsOfEveryControllerArePredictedAsTheyArePlanned) {
  const std::string cell = TRAMMEL_SOURCE_DIR "/config/cell-7.yaml";
  ASSERT_EQ(run("plan",
                {"--cell", cell, "--count", "4", "-o", file("p.csv"), "--rapid", file("p.mod"),
                 "--krl", file("p.src"), "--fanuc", file("p.ls"), "--urscript", file("p.script")}),
            0);
  for (const char* name : {"p.mod", "p.src", "p.ls", "p.script"}) {
    EXPECT_EQ(run("predict", {"--model", model(), file(name), "-o", file("where.csv")}), 0) << name;
    const CsvTable where = CsvTable::parse(text("where.csv"), "where.csv").value();
    EXPECT_GE(where.size(), 4u) << name;
    for (std::size_t row = 0; row < where.size(); ++row)
      EXPECT_NE(where.field(row, where.require("status").value()), "refused")
          << name << " row " << row + 1;
  }
}

TEST_F(CorrectProgram, APredictionOfACorrectedProgramSaysThatItIsCorrected) {
  const std::string before = module("m.mod");
  ASSERT_EQ(correct({"--model", model(), before, "-o", file("out.mod")}), 0);
  const auto said_of = [&](const std::string& name) {
    testing::internal::CaptureStderr();
    EXPECT_EQ(run("predict",
                  {"--model", model(), file(name), "-o", file("p.csv"), "--json", file("p.json")}),
              0);
    return testing::internal::GetCapturedStderr();
  };
  EXPECT_EQ(said_of("m.mod").find("corrected already"), std::string::npos);
  const std::string said = said_of("out.mod");
  EXPECT_NE(said.find("warning: out.mod: it is corrected already, by model "), std::string::npos)
      << said;
  EXPECT_LT(said.find("warning: out.mod"), said.find("targets:")) << said;
  EXPECT_EQ(nlohmann::json::parse(text("p.json"))["notes"][0]["code"], "corrected_already");
}

TEST_F(CorrectProgram, ATargetThatStandsInItsMotionHasAShortNameInTables) {
  const std::string before = module("m.mod");
  std::string lines = text("m.mod");
  const std::string in_motion =
      "[[1800.1,0,1000],[0.669131,0,0.743145,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]";
  const std::string motions = "    MoveL " + in_motion + ",v100,fine,tSpindle;\n    MoveL Offs(" +
                              in_motion + ",0,0,50),v100,fine,tSpindle;\n";
  lines.insert(lines.find("  ENDPROC"), motions);
  folder_.write("m.mod", lines);
  ASSERT_EQ(correct({"--model", model(), before, "-o", file("out.mod"), "--receipt", file("r.csv"),
                     "--json", file("r.json"), "--report", file("r.html")}),
            0);
  const CsvTable receipt = CsvTable::parse(text("r.csv"), "r.csv").value();
  std::vector<std::string> names;
  for (std::size_t k = 0; k < 3; ++k)
    names.push_back(receipt.field(k, receipt.find("name").value()));
  EXPECT_EQ(names, (std::vector<std::string>{"p10", "point 1 at line 6", "point 2 at line 7"}));
  EXPECT_EQ(nlohmann::json::parse(text("r.json"))["targets"][1]["name"], "point 1 at line 6");
  const std::string page = text("r.html");
  EXPECT_EQ(page.find("9E9"), std::string::npos) << "the text of a target";
  ASSERT_EQ(run("predict", {"--model", model(), before, "-o", file("p.csv")}), 0);
  EXPECT_EQ(text("p.csv").find("9E9"), std::string::npos) << text("p.csv");
  EXPECT_NE(text("p.csv").find("point 2 at line 7"), std::string::npos) << text("p.csv");
}

}  // namespace
}  // namespace trammel::cli
