// SPDX-License-Identifier: Apache-2.0
// Edits that can be undone and done again.
#pragma once

#include <scenegraph/scene_editor.h>

#include <vector>

namespace stipple {

class EditHistory {
public:
    // All in one step. What was planted before one that cannot be stays, in the step.
    void insert(SceneEditor& editor, uint32_t group, ChildRef child,
                const std::vector<Affine>& transforms);
    void remove(SceneEditor& editor, InstanceId id);
    void move(SceneEditor& editor, InstanceId id, const Affine& transform);

    // False if there is nothing.
    bool undo(SceneEditor& editor);
    bool redo(SceneEditor& editor);
    size_t undoable() const { return done_; }
    size_t redoable() const { return steps_.size() - done_; }

private:
    // What an instance was and is; no child: not there.
    struct State {
        ChildRef child = ChildRef::none();
        Affine transform;
    };
    struct Change {
        InstanceId id;
        State before, after;
    };
    using Step = std::vector<Change>;
    void add(Step step);
    static void change(SceneEditor& editor, InstanceId id, const State& from, const State& to);

    std::vector<Step> steps_;
    size_t done_ = 0;
};

}  // namespace stipple
