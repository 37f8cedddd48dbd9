// A user's program on the client that openapi-generator makes for Go.
package main

import (
	"bufio"
	"context"
	"encoding/json"
	"errors"
	"io"
	"os"
	"path/filepath"
	"strings"
	"time"

	gridfall "github.com/GIT_USER_ID/GIT_REPO_ID"
)

func check(what string, ok bool, err error) {
	if err != nil {
		panic(what + ": " + err.Error())
	}
	if !ok {
		panic(what)
	}
}

func read(name string) gridfall.Scene {
	text, err := os.ReadFile(filepath.Join(os.Args[2], name))
	check(name, true, err)
	var scene gridfall.Scene
	check(name, true, json.Unmarshal(text, &scene))
	return scene
}

func main() {
	configuration := gridfall.NewConfiguration()
	configuration.Servers = gridfall.ServerConfigurations{{URL: os.Args[1]}}
	client, background := gridfall.NewAPIClient(configuration), context.Background()
	request, endless := gridfall.SubmitJob{}, gridfall.SubmitJob{}
	request.SetScene(read("scene.json"))
	endless.SetScene(read("endless.json"))
	judged, _, err := client.ScenesAPI.ValidateScene(background).SubmitJob(request).Execute()
	check("validate", err == nil && judged.Valid && judged.Estimate.Particles == 64, err)
	request.SetName("go")
	job, _, err := client.JobsAPI.SubmitJob(background).SubmitJob(request).Execute()
	check("submit", err == nil && job.Name == "go", err)
	for job.Status == gridfall.QUEUED || job.Status == gridfall.RUNNING {
		time.Sleep(20 * time.Millisecond)
		job, _, err = client.JobsAPI.GetJob(background, job.Id).Execute()
		check("poll", true, err)
	}
	check("succeed", job.Status == gridfall.SUCCEEDED, nil)
	list, _, err := client.JobsAPI.ListJobs(background).Status([]string{"succeeded"}).Limit(200).Execute()
	check("list", err == nil && len(list.Jobs) > 0, err)
	recording, _, err := client.OutputsAPI.GetRecording(background, job.Id).Execute()
	check("download", true, err)
	magic := make([]byte, 5)
	_, err = io.ReadFull(bufio.NewReader(recording), magic)
	check("recording", string(magic[1:]) == "MCAP", err)
	table, _, err := client.OutputsAPI.GetDiagnostics(background, job.Id).Execute()
	check("diagnostics", err == nil && len(table.Rows) == 6 && *table.Rows[0].MassKg.Get() > 0, err)
	csv, _, err := client.OutputsAPI.GetDiagnosticsCsv(background, job.Id).Execute()
	check("csv", strings.HasPrefix(csv, "frame,time_s,"), err)
	mesh, err := os.Open(filepath.Join(os.Args[2], "mesh.obj"))
	check("mesh", true, err)
	asset, _, err := client.AssetsAPI.UploadAsset(background).Body(mesh).Execute()
	check("upload", err == nil && asset.Kind == "obj", err)
	doomed, _, err := client.JobsAPI.SubmitJob(background).SubmitJob(endless).Execute()
	check("submit", true, err)
	_, _, err = client.JobsAPI.CancelJob(background, doomed.Id).Execute()
	for doomed.Status != gridfall.CANCELED {
		check("cancel", true, err)
		time.Sleep(20 * time.Millisecond)
		doomed, _, err = client.JobsAPI.GetJob(background, doomed.Id).Execute()
	}
	request.Scene.Domain.Dx = -1
	_, _, err = client.JobsAPI.SubmitJob(background).SubmitJob(request).Execute()
	var refused *gridfall.GenericOpenAPIError
	check("refusal", errors.As(err, &refused), nil)
	problem, ok := refused.Model().(gridfall.Problem)
	check("problem", ok && problem.Faults[0].Pointer == "/scene/domain/dx", nil)
}
