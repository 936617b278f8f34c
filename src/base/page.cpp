// SPDX-License-Identifier: Apache-2.0
#include "base/page.hpp"

#include <kainjow/mustache.hpp>
#include <nlohmann/json.hpp>

#include "dynid/base/error.hpp"
#include "dynid/base/text.hpp"

namespace dynid {
namespace {

namespace mustache = kainjow::mustache;

mustache::data data_of(const nlohmann::json& value) {
  if (value.is_object()) {
    mustache::data object(mustache::data::type::object);
    for (const auto& [key, member] : value.items()) object.set(key, data_of(member));
    return object;
  }
  if (value.is_array()) {
    mustache::data list(mustache::data::type::list);
    for (const nlohmann::json& element : value) list.push_back(data_of(element));
    return list;
  }
  if (value.is_boolean()) return value.get<bool>();
  if (value.is_null()) return false;
  if (!value.is_string()) return value.dump();
  const std::string& text = value.get_ref<const std::string&>();
  if (text.empty()) return false;
  return text;
}

}  // namespace

bool has_page_template(const std::string& name) { return detail::page_templates().count(name) > 0; }

std::string rendered_page(const std::string& name, const nlohmann::json& view) {
  const auto& templates = detail::page_templates();
  const auto found = templates.find(name);
  if (found == templates.end()) throw Error("page '" + name + "': there is no such template");
  mustache::data data = data_of(view);
  for (const auto& [partial, text] : templates) {
    data.set("part:" + partial, mustache::data(mustache::partial([&text = text] { return text; })));
    data.set("text:" + partial, text);
  }
  mustache::mustache page(found->second);
  page.set_custom_escape(html_escaped);
  std::string html = page.render(data);
  if (!page.is_valid()) throw Error("page '" + name + "': " + page.error_message());
  return html;
}

}  // namespace dynid
