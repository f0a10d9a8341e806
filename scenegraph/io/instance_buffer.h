// SPDX-License-Identifier: Apache-2.0
// Binary lists of instances beside a scene file. Internal to its reader.
#pragma once

#include <scenegraph/io/scene_reader.h>

namespace stipple {

// A group's "buffer": a file of records of 44 bytes, little-endian, one an instance:
//   uint32 child         index into the buffer's "children"
//   float32 translation  x, y, z, metres, from the buffer's "origin"
//   float32 rotation     quaternion x, y, z, w, of any length but 0
//   float32 scale        x, y, z, not 0
class InstanceBuffer {
public:
    // Reads the file and checks its size. Throws with the place in the scene file.
    InstanceBuffer(SceneReader& reader, const Json& source, const JsonPath& path);

    size_t size() const;
    DBox3 domain() const;  // of the translations
    // Throws naming the first record that is wrong.
    void addTo(InstanceStore& store) const;

private:
    SceneReader& reader_;
    JsonPath path_;
    std::vector<ChildRef> children_;
    DVec3 origin_ = DVec3(0.0);
    std::string bytes_;
};

}  // namespace stipple
