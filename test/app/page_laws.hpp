// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <expat.h>
#include <gtest/gtest.h>

#include <cstring>
#include <map>
#include <set>
#include <string>
#include <vector>

namespace dynid::test {

/// What a page is to whoever cannot see it, or has no mouse: laws that hold for each one.
class PageLaws {
 public:
  static void check(const std::string& page) {
    PageLaws laws;
    XML_Parser parser = XML_ParserCreate(nullptr);
    XML_SetUserData(parser, &laws);
    XML_SetElementHandler(
        parser,
        [](void* of, const XML_Char* name, const XML_Char** attributes) {
          static_cast<PageLaws*>(of)->begin(name, attributes);
        },
        [](void* of, const XML_Char*) { static_cast<PageLaws*>(of)->path_.pop_back(); });
    ASSERT_EQ(XML_Parse(parser, page.data(), static_cast<int>(page.size()), XML_TRUE), XML_STATUS_OK)
        << XML_ErrorString(XML_GetErrorCode(parser)) << " in line " << XML_GetCurrentLineNumber(parser);
    XML_ParserFree(parser);
    EXPECT_EQ(laws.count_["main"], 1);
    EXPECT_EQ(laws.count_["h1"], 1);
    EXPECT_EQ(laws.count_["title"], 1 + laws.count_["svg"]) << "a drawing has a title, too";
    for (const std::string& id : laws.wanted_)
      EXPECT_EQ(laws.ids_.count(id), 1u) << "no element is called " << id;
  }

 private:
  std::vector<std::string> path_;
  std::map<std::string, int> count_;
  std::set<std::string> ids_, wanted_;
  int heading_ = 0;

  void begin(const std::string& name, const XML_Char** list) {
    std::map<std::string, std::string> attributes;
    for (; *list != nullptr; list += 2) attributes[list[0]] = list[1];
    path_.push_back(name);
    ++count_[name];
    const auto has = [&](const char* key) { return attributes.count(key) > 0 && !attributes[key].empty(); };
    if (has("id")) {
      EXPECT_TRUE(ids_.insert(attributes["id"]).second) << "two elements are called " << attributes["id"];
    }
    for (const char* key : {"aria-labelledby", "aria-describedby"})
      if (has(key)) wanted_.insert(attributes[key]);
    if (has("href") && attributes["href"][0] == '#') wanted_.insert(attributes["href"].substr(1));
    if (name == "html") {
      EXPECT_EQ(attributes["lang"], "en");
    } else if (name == "th") {
      EXPECT_TRUE(has("scope")) << "a heading of a table says of what it is one";
    } else if (name == "section" || name == "nav") {
      EXPECT_TRUE(has("aria-labelledby") || has("aria-label")) << "a landmark has a name";
    } else if (name == "svg") {
      EXPECT_TRUE(attributes["role"] == "img" && has("aria-label"));
    } else if (name == "img") {
      EXPECT_TRUE(has("alt"));
    } else if (name.size() == 2 && name[0] == 'h' && std::isdigit(static_cast<unsigned char>(name[1]))) {
      const int level = name[1] - '0';
      EXPECT_LE(level, heading_ + 1) << "a heading is left out above an " << name;
      heading_ = level;
    }
  }
};

}  // namespace dynid::test
