// SPDX-License-Identifier: Apache-2.0
#include <tools/view_window.h>

#include <core/rng.h>
#include <core/stopwatch.h>
#include <core/tone.h>
#include <scenegraph/io/scene_save.h>
#include <scenegraph/pick.h>
#include <tools/view_camera.h>
#include <tools/view_history.h>
#include <tools/view_overlay.h>
#include <tools/view_renderer.h>

#include <GLFW/glfw3.h>
#include <backends/imgui_impl_glfw.h>
#include <backends/imgui_impl_opengl3.h>
#include <imgui.h>

#include <cmath>
#include <cstdio>
#include <optional>

namespace stipple {

namespace {

// The few functions of OpenGL that showing a picture takes; GLFW finds them, so that the program is
// not linked with a GL of its own, which OSMesa's would meet.
struct Gl {
    using GenTextures = void (*)(GLsizei, GLuint*);
    using BindTexture = void (*)(GLenum, GLuint);
    using TexParameteri = void (*)(GLenum, GLenum, GLint);
    using TexImage2D = void (*)(GLenum, GLint, GLint, GLsizei, GLsizei, GLint, GLenum, GLenum,
                                const void*);
    using Clear = void (*)(GLbitfield);
    using Viewport = void (*)(GLint, GLint, GLsizei, GLsizei);
    GenTextures genTextures;
    BindTexture bindTexture;
    TexParameteri texParameteri;
    TexImage2D texImage2D;
    Clear clear;
    Viewport viewport;

    Gl() {
        find(genTextures, "glGenTextures");
        find(bindTexture, "glBindTexture");
        find(texParameteri, "glTexParameteri");
        find(texImage2D, "glTexImage2D");
        find(clear, "glClear");
        find(viewport, "glViewport");
    }

private:
    template <class F>
    static void find(F& function, const char* name) {
        function = reinterpret_cast<F>(glfwGetProcAddress(name));
        if (!function) throw Error(ErrorCode::kInternal, "", std::string("OpenGL lacks ") + name);
    }
};

// GLFW and the window, for as long as it lives.
class Window {
public:
    Window(const std::string& title, int width, int height) {
        if (!glfwInit()) fail();
        glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 3);
        glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 0);
        handle_ = glfwCreateWindow(width, height, title.c_str(), nullptr, nullptr);
        if (!handle_) {
            const std::string reason = lastError();
            glfwTerminate();
            throw Error(ErrorCode::kInternal, "", "no window can be opened: " + reason);
        }
        glfwMakeContextCurrent(handle_);
        glfwSwapInterval(1);
        ImGui::CreateContext();
        ImGui::GetIO().IniFilename = nullptr;  // writes no files
        ImGui_ImplGlfw_InitForOpenGL(handle_, true);
        ImGui_ImplOpenGL3_Init("#version 130");
    }
    ~Window() {
        ImGui_ImplOpenGL3_Shutdown();
        ImGui_ImplGlfw_Shutdown();
        ImGui::DestroyContext();
        glfwDestroyWindow(handle_);
        glfwTerminate();
    }
    GLFWwindow* get() const { return handle_; }

private:
    static std::string lastError() {
        const char* text = nullptr;
        glfwGetError(&text);
        return text ? text : "unknown reason";
    }
    [[noreturn]] static void fail() {
        throw Error(ErrorCode::kInternal, "", "no window can be opened: " + lastError());
    }

    GLFWwindow* handle_ = nullptr;
};

enum class Mode { kSelect, kPlant, kBrush };

const char* const kKeys =
    "left drag   orbit about what is under the cursor\n"
    "right drag  look around\n"
    "wheel       towards it, away from it\n"
    "W A S D     fly; Q E down and up; Shift faster\n"
    "1           select: click; drag with Shift moves\n"
    "2           plant: click\n"
    "3           brush: click plants several\n"
    "Delete      remove what is selected\n"
    "Ctrl+Z, Y   undo, redo\n"
    "Ctrl+S      save; Ctrl+Q quit\n"
    "O           overlay: cut, points and triangles, points a pixel, depth\n"
    "P           sparkle in: 1, 10, 50, 75, 100 % of the points\n"
    "F12         screenshot\n"
    "H           this panel";

class Viewer {
public:
    Viewer(LiveScene& scene, const Camera& camera, const std::vector<std::string>& palette,
           const ViewOptions& options)
        : options_(options),
          palette_(palette),
          window_(options.title, options.settings.width, options.settings.height),
          renderer_(scene),
          camera_(camera),
          settings_(options.settings) {
        gl_.genTextures(1, &texture_);
        gl_.bindTexture(GL_TEXTURE_2D, texture_);
        gl_.texParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
        gl_.texParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
    }

    void run() {
        while (!glfwWindowShouldClose(window_.get())) {
            glfwPollEvents();
            ImGui_ImplOpenGL3_NewFrame();
            ImGui_ImplGlfw_NewFrame();
            ImGui::NewFrame();
            fitToWindow();
            handleMouse();
            handleKeys();
            if (shows_panel_) drawPanel();
            showPicture();
            if (has_changed_) {
                renderer_.show({camera_, settings_, 1.0 / options_.frame_rate,
                                overlay_ == Overlay::kCut, overlay_ == Overlay::kKinds, sparkles_});
                has_changed_ = false;
            }
            ImGui::Render();
            int width = 0, height = 0;
            glfwGetFramebufferSize(window_.get(), &width, &height);
            gl_.viewport(0, 0, width, height);
            gl_.clear(GL_COLOR_BUFFER_BIT);
            ImGui_ImplOpenGL3_RenderDrawData(ImGui::GetDrawData());
            glfwSwapBuffers(window_.get());
        }
    }

private:
    void fitToWindow() {
        int width = 0, height = 0;
        glfwGetWindowSize(window_.get(), &width, &height);
        if (width < 16 || height < 16 || (width == settings_.width && height == settings_.height))
            return;
        settings_.width = width;
        settings_.height = height;
        has_changed_ = true;
    }

    // The newest picture into the texture, and the texture behind all else.
    void showPicture() {
        if (renderer_.take(picture_)) {
            Image shown = picture_.image;
            applyTone(settings_.tone, shown);
            applyOverlay(overlay_, picture_, shown);
            edges_ = cutEdges(picture_);
            rgba_.assign(size_t(shown.width) * size_t(shown.height) * 4, 255);
            for (int y = 0; y < shown.height; ++y) {
                for (int x = 0; x < shown.width; ++x) {
                    const float* p = shown.pixel(x, y);
                    uint8_t* out = &rgba_[(size_t(y) * size_t(shown.width) + size_t(x)) * 4];
                    for (int c = 0; c < 3; ++c) {
                        out[c] = uint8_t(
                            std::clamp(srgbFromLinear(std::max(p[c], 0.0f)), 0.0f, 1.0f) * 255.0f +
                            0.5f);
                    }
                }
            }
            gl_.bindTexture(GL_TEXTURE_2D, texture_);
            gl_.texImage2D(GL_TEXTURE_2D, 0, GL_RGBA8, shown.width, shown.height, 0, GL_RGBA,
                           GL_UNSIGNED_BYTE, rgba_.data());
            ++pictures_;
        }
        if (pictures_ == 0) return;
        const ImVec2 size = ImGui::GetIO().DisplaySize;
        ImGui::GetBackgroundDrawList()->AddImage(reinterpret_cast<ImTextureID>(uintptr_t(texture_)),
                                                 ImVec2(0, 0), size);
        if (overlay_ == Overlay::kCut) drawCut();
        if (selected_) drawSelection();
    }

    void drawCut() const {
        const ImVec2 size = ImGui::GetIO().DisplaySize;
        for (const CutEdge& edge : edges_) {
            const int alpha = int(220.0f - 180.0f * edge.dim);
            ImGui::GetBackgroundDrawList()->AddLine(ImVec2(edge.a.x * size.x, edge.a.y * size.y),
                                                    ImVec2(edge.b.x * size.x, edge.b.y * size.y),
                                                    IM_COL32(255, 230, 60, alpha));
        }
    }

    // What the picture shows under the cursor; none for background.
    struct Under {
        DVec3 point = DVec3(0.0);
        double depth = 0.0;
        uint32_t object = 0;
    };
    std::optional<Under> underCursor() const {
        if (pictures_ == 0) return std::nullopt;
        const ImGuiIO& io = ImGui::GetIO();
        const Image& image = picture_.image;
        const int x = int(io.MousePos.x / io.DisplaySize.x * float(image.width)),
                  y = int(io.MousePos.y / io.DisplaySize.y * float(image.height));
        if (x < 0 || y < 0 || x >= image.width || y >= image.height) return std::nullopt;
        const float* p = image.pixel(x, y);
        const float depth = p[image.channelIndex("depth")];
        if (!std::isfinite(depth)) return std::nullopt;
        const uint32_t object = uint32_t(p[image.channelIndex("object")]);
        return Under{worldPoint(picture_.view, x, y, double(depth)), double(depth), object};
    }

    void handleMouse() {
        const ImGuiIO& io = ImGui::GetIO();
        if (io.WantCaptureMouse) return;
        if (ImGui::IsMouseClicked(ImGuiMouseButton_Left) ||
            ImGui::IsMouseClicked(ImGuiMouseButton_Right)) {
            grabbed_ = underCursor();
            dragged_ = 0.0f;
        }
        const float dx = io.MouseDelta.x, dy = io.MouseDelta.y;
        constexpr double kTurn = 0.005;  // radians a pixel
        if (ImGui::IsMouseDown(ImGuiMouseButton_Left)) {
            dragged_ += std::abs(dx) + std::abs(dy);
            if (dragged_ > kClickSlack && (dx != 0.0f || dy != 0.0f) && !io.KeyShift) {
                const DVec3 about =
                    grabbed_ ? grabbed_->point : camera_.eye + 50.0 * camera_.world_from_camera[2];
                camera_ = orbited(camera_, about, dx * kTurn, -dy * kTurn);
                has_changed_ = true;
            }
        }
        if (ImGui::IsMouseReleased(ImGuiMouseButton_Left)) {
            if (dragged_ <= kClickSlack) click();
            if (dragged_ > kClickSlack && io.KeyShift && selected_) dragSelected();
        }
        if (ImGui::IsMouseDown(ImGuiMouseButton_Right) && (dx != 0.0f || dy != 0.0f)) {
            camera_ = turned(camera_, dx * kTurn, -dy * kTurn);
            has_changed_ = true;
        }
        if (io.MouseWheel != 0.0f) {
            const std::optional<Under> under = underCursor();
            const DVec3 way =
                under ? under->point - camera_.eye : camera_.world_from_camera[2] * 20.0;
            camera_.eye += way * (1.0 - std::pow(0.85, double(io.MouseWheel)));
            has_changed_ = true;
        }
    }

    void click() {
        const std::optional<Under> under = underCursor();
        if (mode_ != Mode::kSelect) {
            if (under && mode_ == Mode::kPlant) plant({under->point});
            if (under && mode_ == Mode::kBrush) plant(placesAround(*under));
            return;
        }
        selected_.reset();
        if (!under) return;
        renderer_.edit([&](SceneEditor& editor) {
            const double tolerance = 4.0 * under->depth / picture_.view.focal;
            const std::vector<uint32_t> path =
                pathOfObject(editor.scene(), under->object, under->point, tolerance);
            if (!path.empty()) selected_ = editor.find(path), selected_point_ = under->point;
        });
        status_ = selected_ ? "selected instance " + std::to_string(selected_->index)
                            : "nothing that can be selected";
    }

    template <class Edit>
    void tryEdit(const std::string& done, const Edit& edit) {
        try {
            const Stopwatch watch;
            renderer_.edit([&](SceneEditor& editor) { edit(editor); });
            char text[160];
            std::snprintf(text, sizeof text, "%s (%.1f us)", done.c_str(), watch.seconds() * 1e6);
            status_ = text;
        } catch (const Error& error) {
            status_ = error.what();
        }
    }

    // One step, however many they are.
    void plant(const std::vector<DVec3>& at) {
        if (palette_.empty() || at.empty()) return;
        const std::string& name = palette_[size_t(planted_)];
        Rng rng{uint64_t(history_.undoable()) + 1};
        std::vector<Affine> places;
        for (const DVec3& p : at) {
            const double angle = rng.uniform(0.0, 2.0 * kPi), scale = rng.uniform(0.8, 1.2);
            const double c = std::cos(angle) * scale, s = std::sin(angle) * scale;
            places.push_back({DMat3(c, 0, -s, 0, scale, 0, s, 0, c), p});
        }
        const std::string count = at.size() == 1 ? "" : std::to_string(at.size()) + " of ";
        tryEdit("planted " + count + name, [&](SceneEditor& editor) {
            history_.insert(editor, editor.scene().root, editor.scene().names.at(name), places);
        });
    }

    // Evenly spread about a point, as high as what the picture shows there; on the level of the
    // point where it shows something else.
    std::vector<DVec3> placesAround(const Under& center) const {
        Rng rng{uint64_t(history_.undoable()) + 1};
        std::vector<DVec3> places;
        for (int i = 0; i < brush_count_; ++i) {
            const double angle = rng.uniform(0.0, 2.0 * kPi),
                         r = double(brush_radius_) * std::sqrt(rng.uniform(0.0, 1.0));
            DVec3 p = center.point + r * DVec3(std::cos(angle), 0.0, std::sin(angle));
            // The ray through the place meets the ground elsewhere unless the ground is level:
            // a few steps go there.
            for (int step = 0; step < 4; ++step) {
                const std::optional<DVec3> seen = shownAt(p);
                if (!seen || std::abs(seen->y - center.point.y) > double(brush_radius_)) break;
                p.y = seen->y;
            }
            places.push_back(p);
        }
        return places;
    }

    // What the picture shows in the direction of a point.
    std::optional<DVec3> shownAt(const DVec3& p_world) const {
        const View& view = picture_.view;
        const DVec3 p = DMat3(view.camera_from_world) * (p_world - view.eye_world);
        if (p.z <= 0.0) return std::nullopt;
        const double scale = view.orthographic ? view.focal : view.focal / p.z;
        const Image& image = picture_.image;
        const double x = (view.center_x + p.x * scale) / view.subpixels,
                     y = (view.center_y + p.y * scale) / view.subpixels;
        if (!(x >= 0.0 && y >= 0.0 && x < image.width && y < image.height)) return std::nullopt;
        const float depth = image.pixel(int(x), int(y))[image.channelIndex("depth")];
        if (!std::isfinite(depth)) return std::nullopt;
        return worldPoint(view, int(x), int(y), double(depth));
    }

    // To where it was let go.
    void dragSelected() {
        const std::optional<Under> under = underCursor();
        if (!under || !grabbed_) return;
        tryEdit("moved", [&](SceneEditor& editor) {
            Affine place = editor.groupFromChild(*selected_);
            place.translation += under->point - grabbed_->point;
            history_.move(editor, *selected_, place);
            selected_point_ = under->point;
        });
    }

    void handleKeys() {
        const ImGuiIO& io = ImGui::GetIO();
        if (io.WantCaptureKeyboard && ImGui::IsAnyItemActive()) return;
        const auto isDown = [&](int key) { return glfwGetKey(window_.get(), key) == GLFW_PRESS; };
        const auto isPressed = [&](int key) { return ImGui::IsKeyPressed(key, false); };
        if (io.KeyCtrl) {
            if (isPressed(GLFW_KEY_Z))
                tryEdit("undone", [&](SceneEditor& editor) { history_.undo(editor); });
            if (isPressed(GLFW_KEY_Y))
                tryEdit("done again", [&](SceneEditor& editor) { history_.redo(editor); });
            if (isPressed(GLFW_KEY_S)) save();
            if (isPressed(GLFW_KEY_Q)) glfwSetWindowShouldClose(window_.get(), GLFW_TRUE);
            return;
        }
        const double step = pace_ * double(io.DeltaTime) * (io.KeyShift ? 8.0 : 1.0);
        DVec3 way(0.0);
        way.x = (isDown(GLFW_KEY_D) - isDown(GLFW_KEY_A)) * step;
        way.y = (isDown(GLFW_KEY_E) - isDown(GLFW_KEY_Q)) * step;
        way.z = (isDown(GLFW_KEY_W) - isDown(GLFW_KEY_S)) * step;
        if (way != DVec3(0.0)) {
            camera_ = flown(camera_, way);
            has_changed_ = true;
        }
        if (isPressed(GLFW_KEY_1)) mode_ = Mode::kSelect;
        if (isPressed(GLFW_KEY_2)) mode_ = Mode::kPlant;
        if (isPressed(GLFW_KEY_3)) mode_ = Mode::kBrush;
        if (isPressed(GLFW_KEY_O)) {
            overlay_ = Overlay((int(overlay_) + 1) % kOverlayCount);
            has_changed_ = true;
        }
        if (isPressed(GLFW_KEY_P)) {
            sparkles_ = !sparkles_;
            has_changed_ = true;
        }
        if (isPressed(GLFW_KEY_H)) shows_panel_ = !shows_panel_;
        if (isPressed(GLFW_KEY_F12)) screenshot();
        if (isPressed(GLFW_KEY_DELETE) && selected_) {
            tryEdit("removed", [&](SceneEditor& editor) { history_.remove(editor, *selected_); });
            selected_.reset();
        }
    }

    void save() {
        if (options_.save_path.empty()) {
            status_ = "only scene files can be saved";
            return;
        }
        tryEdit("saved " + options_.save_path, [&](SceneEditor& editor) {
            saveScene(editor.scene(), editor.addedAssets(), options_.save_path);
        });
    }

    void screenshot() {
        if (pictures_ == 0) return;
        try {
            Image shown = picture_.image;
            applyTone(settings_.tone, shown);
            applyOverlay(overlay_, picture_, shown);
            saveImage(shown, options_.screenshot_path);
            status_ = "wrote " + options_.screenshot_path;
        } catch (const Error& error) {
            status_ = error.what();
        }
    }

    void drawSelection() {
        const View& view = picture_.view;
        const DVec3 p = view.camera_from_world * (selected_point_ - view.eye_world);
        if (p.z <= 0.0) return;
        const double scale = view.orthographic ? view.focal : view.focal / p.z;
        const ImVec2 size = ImGui::GetIO().DisplaySize;
        const ImVec2 at(float((view.center_x + p.x * scale) / view.subWidth()) * size.x,
                        float((view.center_y + p.y * scale) / view.subHeight()) * size.y);
        ImGui::GetBackgroundDrawList()->AddCircle(at, 12.0f, IM_COL32(255, 200, 0, 255), 0, 2.0f);
    }

    void drawPanel() {
        ImGui::SetNextWindowPos(ImVec2(8, 8), ImGuiCond_FirstUseEver);
        ImGui::Begin("Stipple", nullptr, ImGuiWindowFlags_AlwaysAutoResize);
        int mode = int(mode_);
        ImGui::RadioButton("select (1)", &mode, int(Mode::kSelect));
        ImGui::SameLine();
        ImGui::RadioButton("plant (2)", &mode, int(Mode::kPlant));
        ImGui::SameLine();
        ImGui::RadioButton("brush (3)", &mode, int(Mode::kBrush));
        mode_ = Mode(mode);
        if (mode_ == Mode::kBrush) {
            ImGui::SliderFloat("metres about the click", &brush_radius_, 1.0f, 200.0f, "%.0f",
                               ImGuiSliderFlags_Logarithmic);
            ImGui::SliderInt("plants", &brush_count_, 1, 500, "%d", ImGuiSliderFlags_Logarithmic);
        }
        if (!palette_.empty() && ImGui::BeginCombo("asset", palette_[size_t(planted_)].c_str())) {
            for (int i = 0; i < int(palette_.size()); ++i) {
                if (ImGui::Selectable(palette_[size_t(i)].c_str(), i == planted_)) planted_ = i;
            }
            ImGui::EndCombo();
        }
        static constexpr const char* kReconstructions[] = {"per-pixel", "splat", "gaussian",
                                                           "pull-push", "ewa",   "bins"};
        int reconstruct = int(settings_.reconstruct);
        if (ImGui::Combo("reconstruction", &reconstruct, kReconstructions, 6)) {
            settings_.reconstruct = Reconstruct(reconstruct);
            has_changed_ = true;
        }
        float samples = float(settings_.samples);
        if (ImGui::SliderFloat("K", &samples, 0.25f, 8.0f, "%.2f")) {
            settings_.samples = std::max(double(samples), 0.001);
            has_changed_ = true;
        }
        has_changed_ |= ImGui::SliderInt("subpixels", &settings_.subpixels, 1, 8);
        has_changed_ |= ImGui::Checkbox("shadows", &settings_.shadows);
        int overlay = int(overlay_);
        if (ImGui::Combo("overlay (O)", &overlay, kOverlayNames, kOverlayCount)) {
            overlay_ = Overlay(overlay);
            has_changed_ = true;
        }
        has_changed_ |= ImGui::Checkbox("sparkle in (P)", &sparkles_);
        ImGui::SliderFloat("metres a second", &pace_, 1.0f, 1000.0f, "%.0f",
                           ImGuiSliderFlags_Logarithmic);
        ImGui::Separator();
        const FrameStats& stats = picture_.stats;
        ImGui::Text("picture %d of %d, %.3g %% of the points: %d x %d, %.0f ms", picture_.level + 1,
                    picture_.level_count, picture_.percent, picture_.image.width,
                    picture_.image.height, stats.seconds * 1e3);
        ImGui::Text("%.2f s after the last change", picture_.full_seconds);
        ImGui::Text("overestimation %.2f", stats.overestimation);
        ImGui::Text("%.2f million points drawn, %.2f kept", double(stats.points_drawn) * 1e-6,
                    double(stats.points_kept) * 1e-6);
        ImGui::Text("%.2f million small triangles, %llu large",
                    double(stats.small_triangles) * 1e-6,
                    static_cast<unsigned long long>(stats.large_triangles));
        ImGui::Text("point lists %.0f MB", double(stats.cache_bytes) * 1e-6);
        ImGui::Text("undo %zu, redo %zu", history_.undoable(), history_.redoable());
        ImGui::TextUnformatted(status_.c_str());
        ImGui::Separator();
        ImGui::TextUnformatted(kKeys);
        ImGui::End();
    }

    static constexpr float kClickSlack = 4.0f;  // pixels

    const ViewOptions& options_;
    const std::vector<std::string> palette_;
    Window window_;
    Gl gl_;
    ViewRenderer renderer_;
    Camera camera_;
    RenderSettings settings_;
    EditHistory history_;
    ShownPicture picture_;
    int pictures_ = 0;
    GLuint texture_ = 0;
    std::vector<uint8_t> rgba_;
    Mode mode_ = Mode::kSelect;
    int planted_ = 0;
    float brush_radius_ = 15.0f;  // m
    int brush_count_ = 20;
    Overlay overlay_ = Overlay::kNone;
    std::vector<CutEdge> edges_;
    bool sparkles_ = false;
    std::optional<Under> grabbed_;
    float dragged_ = 0.0f;
    std::optional<InstanceId> selected_;
    DVec3 selected_point_ = DVec3(0.0);
    float pace_ = 20.0f;
    bool has_changed_ = true, shows_panel_ = true;
    std::string status_ = "ready";
};

}  // namespace

void runViewWindow(LiveScene& scene, const Camera& camera, const std::vector<std::string>& palette,
                   const ViewOptions& options) {
    Viewer(scene, camera, palette, options).run();
}

}  // namespace stipple
