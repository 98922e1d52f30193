#include "clients/cam/sites.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "server/base/plain_text.h"

namespace trammel::cam {

namespace {

/// One use of each tool and frame.
std::vector<SiteUse> ways_of(const Site& site, bool joints) {
  std::vector<SiteUse> ways;
  for (const SiteUse& use : site.uses) {
    const bool known = std::any_of(ways.begin(), ways.end(), [&](const SiteUse& way) {
      return way.tool == use.tool && (joints || way.frame == use.frame);
    });
    if (!known) ways.push_back(use);
  }
  return ways;
}

}  // namespace

void Sites::add(std::size_t file, std::size_t begin, const std::string& name, SiteUse use) {
  Site& site = sites_[{file, begin}];
  if (site.uses.empty()) {
    site.file = file;
    site.begin = begin;
    site.name = name;
  }
  site.uses.push_back(std::move(use));
}

std::string used_differently(const Program& program, const std::vector<SiteUse>& ways) {
  std::vector<std::string> texts;
  for (const SiteUse& way : ways) {
    texts.push_back(fmt::format("tool {} in {} ({} line {})", called(program.tools[way.tool]),
                                shown(program.frames[way.frame].name), program.files[way.file].name,
                                way.line));
  }
  return fmt::format("it is used in different ways: {}", fmt::join(texts, ", "));
}

void Sites::finish(Program& program, const Describe& describe) const {
  for (const auto& [place, site] : sites_) {
    const SiteUse& first = site.uses.front();
    ProgramTarget target;
    target.name = site.name;
    target.file = site.file;
    target.line = first.line;
    target.motion = first.motion;
    target.tool = first.tool;
    target.frame = first.frame;
    target.linear = first.linear;
    for (const SiteUse& use : site.uses) {
      if (std::find(target.used_at.begin(), target.used_at.end(), use.line) == target.used_at.end())
        target.used_at.push_back(use.line);
    }
    std::string why = describe(site, target);
    const bool joints = is_joints(target.coordinates);
    if (why.empty()) {
      const std::vector<SiteUse> ways = ways_of(site, joints);
      if (ways.size() > 1) why = used_differently(program, ways);
    }
    if (why.empty()) why = program.tools[target.tool].why_not;
    if (why.empty() && !joints) why = program.frames[target.frame].why_not;
    if (!why.empty()) {
      program.left.push_back({target.name, target.file, target.line, target.motion, why});
      for (const SiteUse& use : site.uses) program.moves[use.move].left_some = true;
      continue;
    }
    for (const SiteUse& use : site.uses)
      program.moves[use.move].targets.push_back(program.targets.size());
    program.targets.push_back(std::move(target));
  }
}

}  // namespace trammel::cam
