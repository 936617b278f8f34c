// SPDX-License-Identifier: Apache-2.0
#include <tinyxml2.h>

#include <filesystem>
#include <map>
#include <set>

#include "dynid/base/error.hpp"
#include "dynid/base/file.hpp"
#include "dynid/base/number.hpp"
#include "dynid/base/text.hpp"
#include "dynid/model/mjcf.hpp"

namespace dynid {
namespace {

namespace fs = std::filesystem;
using tinyxml2::XMLElement;
using tinyxml2::XMLNode;

/// What is only looked at, or only steers MuJoCo's own solver, sensors and start.
const std::set<std::string> mjcf_looks = {"texture", "material", "skin",   "visual",   "keyframe",
                                          "sensor",  "contact",  "custom", "statistic"};

std::string attribute_of(const XMLElement& element, const char* key) {
  const char* value = element.Attribute(key);
  return value != nullptr ? value : "";
}

/// The parts of an MJCF that say what the robot is.
class MjcfRewriter {
 public:
  MjcfRewriter(const std::string& text, const std::string& name)
      : name_(name), folder_(fs::absolute(name).parent_path()) {
    parse(document_, text, name);
    XMLElement* root = document_.RootElement();
    if (root == nullptr || std::string(root->Name()) != "mujoco")
      throw Error(name + ": the root element is not <mujoco>: not an MJCF");
    put_includes_in(*root, folder_, 0);
    for (XMLElement* c = root->FirstChildElement("compiler"); c != nullptr;
         c = c->NextSiblingElement("compiler")) {
      for (const auto& [key, value] : {std::pair{"assetdir", &mesh_folder_}, {"meshdir", &mesh_folder_}})
        if (c->Attribute(key) != nullptr) *value = attribute_of(*c, key);
      if (c->Attribute("strippath") != nullptr) strip_ = attribute_of(*c, "strippath") == "true";
      if (c->Attribute("inertiafromgeom") != nullptr)
        from_geoms_ = attribute_of(*c, "inertiafromgeom") == "true";
      for (const char* key : {"assetdir", "meshdir", "texturedir", "strippath"}) c->DeleteAttribute(key);
    }
    leave_looks_out(*root);
    reduce_options(*root);
    find_files(*root);
    for (XMLElement* w = root->FirstChildElement("worldbody"); w != nullptr;
         w = w->NextSiblingElement("worldbody"))
      leave_geoms_out(*w, true);
    take_kv(*root);
    tinyxml2::XMLPrinter printer;
    document_.Print(&printer);
    out_.text = printer.CStr();
  }

  MjcfText result() { return std::move(out_); }

 private:
  static void parse(tinyxml2::XMLDocument& document, const std::string& text, const std::string& name) {
    if (document.Parse(text.c_str(), text.size()) == tinyxml2::XML_SUCCESS) return;
    throw Error(name + ":" + std::to_string(document.ErrorLineNum()) + ": not well-formed XML (" +
                tinyxml2::XMLDocument::ErrorIDToName(document.ErrorID()) + ")");
  }

  void put_includes_in(XMLElement& parent, const fs::path& folder, int level) {
    for (XMLElement* e = parent.FirstChildElement(); e != nullptr;) {
      XMLElement* const next = e->NextSiblingElement();
      if (std::string(e->Name()) == "include") {
        const std::string file = attribute_of(*e, "file");
        if (level > 20) throw Error(name_ + ": includes of '" + file + "' within each other");
        fs::path path = folder_ / file;  // MuJoCo's rule, before what people expect
        if (!fs::exists(path)) path = folder / file;
        tinyxml2::XMLDocument part;
        parse(part, read_file(path.string()), path.string());
        XMLNode* at = e;
        for (XMLNode* c = part.RootElement() != nullptr ? part.RootElement()->FirstChild() : nullptr;
             c != nullptr; c = c->NextSibling())
          at = parent.InsertAfterChild(at, c->DeepClone(&document_));
        XMLElement* first = e->NextSiblingElement();
        parent.DeleteChild(e);
        // What was put in may include more.
        if (part.RootElement() != nullptr)
          put_includes_in_from(parent, first, next, path.parent_path(), level + 1);
      } else {
        put_includes_in(*e, folder, level);
      }
      e = next;
    }
  }
  void put_includes_in_from(XMLElement& parent, XMLElement* first, const XMLElement* end,
                            const fs::path& folder, int level) {
    // A wrapper keeps the loop over siblings in one place.
    XMLElement* const wrapper = document_.NewElement("wrapper");
    XMLNode* before = first != nullptr && first != end ? first->PreviousSibling() : nullptr;
    if (first == nullptr || first == end) return document_.DeleteNode(wrapper);
    for (XMLElement* e = first; e != nullptr && e != end;) {
      XMLElement* const next = e->NextSiblingElement();
      wrapper->InsertEndChild(e);
      e = next;
    }
    document_.InsertEndChild(wrapper);
    put_includes_in(*wrapper, folder, level);
    for (XMLNode* e = wrapper->FirstChild(); e != nullptr;) {
      XMLNode* const next = e->NextSibling();
      before = before != nullptr ? parent.InsertAfterChild(before, e) : parent.InsertFirstChild(e);
      e = next;
    }
    document_.DeleteChild(wrapper);
  }

  void leave_looks_out(XMLElement& parent) {
    for (XMLElement* e = parent.FirstChildElement(); e != nullptr;) {
      XMLElement* const next = e->NextSiblingElement();
      if (mjcf_looks.count(e->Name()) > 0) {
        parent.DeleteChild(e);
      } else {
        e->DeleteAttribute("material");
        leave_looks_out(*e);
      }
      e = next;
    }
  }

  /// Of `<option>` what acts on the robot; the rest, which changes from version to version, is the solver's.
  static void reduce_options(XMLElement& root) {
    for (XMLElement* o = root.FirstChildElement("option"); o != nullptr;
         o = o->NextSiblingElement("option")) {
      std::vector<std::string> others;
      for (const tinyxml2::XMLAttribute* a = o->FirstAttribute(); a != nullptr; a = a->Next())
        if (std::set<std::string>{"gravity", "density", "viscosity", "wind"}.count(a->Name()) == 0)
          others.emplace_back(a->Name());
      for (const std::string& key : others) o->DeleteAttribute(key.c_str());
      for (XMLElement* f = o->FirstChildElement("flag"); f != nullptr; f = f->NextSiblingElement("flag")) {
        const std::string gravity = attribute_of(*f, "gravity");
        while (f->FirstAttribute() != nullptr) f->DeleteAttribute(f->FirstAttribute()->Name());
        if (!gravity.empty()) f->SetAttribute("gravity", gravity.c_str());
      }
    }
  }

  void find_files(XMLElement& root) {
    for (XMLElement* assets = root.FirstChildElement("asset"); assets != nullptr;
         assets = assets->NextSiblingElement("asset")) {
      for (XMLElement* e = assets->FirstChildElement(); e != nullptr;) {
        XMLElement* const next = e->NextSiblingElement();
        const std::string file = attribute_of(*e, "file");
        if (!file.empty()) {
          const fs::path given = strip_ ? fs::path(file).filename() : fs::path(file);
          const fs::path path = given.is_absolute() ? given : folder_ / mesh_folder_ / given;
          if (fs::exists(path)) {
            e->SetAttribute("file", path.c_str());
          } else {
            const std::string name = attribute_of(*e, "name");
            missing_[name.empty() ? fs::path(file).stem().string() : name] = file;
            out_.missing.push_back(file);
            assets->DeleteChild(e);
          }
        }
        e = next;
      }
    }
  }

  /// Leaves out the geoms of missing meshes; `fixed`: the body never moves, its inertia is nobody's concern.
  void leave_geoms_out(XMLElement& body, bool fixed) {
    const bool has_inertial = body.FirstChildElement("inertial") != nullptr && !from_geoms_;
    for (XMLElement* e = body.FirstChildElement(); e != nullptr;) {
      XMLElement* const next = e->NextSiblingElement();
      const std::string tag = e->Name();
      if (tag == "body" || tag == "frame" || tag == "replicate") {
        const bool moves =
            e->FirstChildElement("joint") != nullptr || e->FirstChildElement("freejoint") != nullptr;
        leave_geoms_out(*e, fixed && !moves);
      } else if (tag == "geom" || tag == "site") {
        const auto mesh = missing_.find(attribute_of(*e, "mesh"));
        const auto field = missing_.find(attribute_of(*e, "hfield"));
        if (mesh != missing_.end() || field != missing_.end()) {
          if (tag == "geom" && !has_inertial && !fixed)
            throw Error(name_ + ": body '" + attribute_of(body, "name") +
                        "' takes its inertia from its geoms, and " +
                        (mesh != missing_.end() ? mesh : field)->second +
                        " is not there: give the file, or an explicit <inertial>");
          body.DeleteChild(e);
        }
      }
      e = next;
    }
  }

  static bool kv_of(XMLElement& position, double& kv) {
    const std::string text = attribute_of(position, "kv");
    position.DeleteAttribute("kv");
    position.DeleteAttribute("inheritrange");  // of commands; since version 3.1
    return !text.empty() && parse_number(text, kv);
  }

  void read_defaults(XMLElement& section, double kv, std::map<std::string, double>& classes) {
    for (XMLElement* p = section.FirstChildElement("position"); p != nullptr;
         p = p->NextSiblingElement("position"))
      kv_of(*p, kv);
    const std::string name = attribute_of(section, "class");
    classes[name.empty() ? "main" : name] = kv;
    for (XMLElement* d = section.FirstChildElement("default"); d != nullptr;
         d = d->NextSiblingElement("default"))
      read_defaults(*d, kv, classes);
  }

  void take_kv(XMLElement& root) {
    std::map<std::string, double> classes = {{"main", 0.0}};
    std::string main = "main";
    for (XMLElement* d = root.FirstChildElement("default"); d != nullptr;
         d = d->NextSiblingElement("default")) {
      if (d->Attribute("class") != nullptr) main = attribute_of(*d, "class");
      read_defaults(*d, classes[main], classes);
    }
    for (XMLElement* all = root.FirstChildElement("actuator"); all != nullptr;
         all = all->NextSiblingElement("actuator"))
      for (XMLElement* a = all->FirstChildElement(); a != nullptr; a = a->NextSiblingElement()) {
        double kv = 0.0;
        if (std::string(a->Name()) == "position") {
          const std::string name = attribute_of(*a, "class");
          const auto found = classes.find(name.empty() ? main : name);
          if (found != classes.end()) kv = found->second;
          kv_of(*a, kv);
        }
        out_.position_kv.push_back(kv);
      }
  }

  std::string name_;
  fs::path folder_;
  std::string mesh_folder_;
  bool strip_ = false, from_geoms_ = false;
  std::map<std::string, std::string> missing_;  ///< name of a mesh or height field: its file
  tinyxml2::XMLDocument document_;
  MjcfText out_;
};

}  // namespace

bool is_mjcf(const std::string& text) {
  tinyxml2::XMLDocument document;
  if (document.Parse(text.c_str(), text.size()) == tinyxml2::XML_SUCCESS)
    return document.RootElement() != nullptr && std::string(document.RootElement()->Name()) == "mujoco";
  return text.find("<mujoco") != std::string::npos && text.find("<robot") == std::string::npos;
}

MjcfText parse_mjcf_text(const std::string& text, const std::string& name) {
  return MjcfRewriter(text, name).result();
}

MjcfText read_mjcf_text(const std::string& path) { return parse_mjcf_text(read_file(path), path); }

}  // namespace dynid
